// Starts Python in WebAssembly with a game, on a page and under node alike.
//
// loadPyodide: of the Pyodide to use
// indexURL: where that Pyodide stands
// read: async (name) => bytes of a file of the page's folder
// say: (text) => shows what happens; loading takes seconds
export async function load(loadPyodide, indexURL, read, say) {
  say('loading Python');
  const python = await loadPyodide({ indexURL, env: { HOME: '/home/pyodide' } });
  say('loading numpy');
  await python.loadPackage('numpy', { messageCallback: () => {}, errorCallback: () => {} });
  if (!python.runPython('import importlib.util; importlib.util.find_spec("numpy") is not None')) {
    throw new Error(`the Pyodide at ${indexURL} has no numpy, which carom needs: take one that comes with its packages`);
  }
  say('loading the game');
  python.unpackArchive(await read('game.zip'), 'zip', { extractDir: '/game' });
  python.runPython('import sys; sys.path.insert(0, "/game")');
  return python;
}

// The last line of a Python error is what a player can tell its maker.
export function reason(error) {
  return String(error.message ?? error).trim().split('\n').pop();
}
