// A button runs its scene in place of the picture above it.
const root = new URL('.', document.currentScript.src);
document.addEventListener('click', (event) => {
  const button = event.target.closest('[data-live]');
  if (!button) return;
  let picture = button.parentElement.previousElementSibling;
  picture = picture.querySelector('img') ?? picture;
  const frame = document.createElement('iframe');
  frame.src = new URL(`live/index.html?${button.dataset.live}`, root);
  frame.title = picture.alt;
  frame.style.cssText = `border: 0; width: ${picture.width}px; aspect-ratio: ${picture.width} / ${picture.height}`;
  picture.replaceWith(frame);
  button.remove();
});
