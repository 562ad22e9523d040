// Starts Python in WebAssembly with a game, in a browser and under node alike.
//
// page: what page.json says
// place: URL of the folder of Pyodide, with a slash at its end; indexURL: the same, as Pyodide wants it
// read: async (name) => bytes of a file of the page's folder
// say: (text) => shows what happens, loading takes seconds; print: (line) => shows what Python prints
export async function load(page, place, indexURL, read, say, print) {
  say('loading Python');
  const { loadPyodide } = await import(`${place}pyodide.mjs`).catch(() => {
    throw new Error(`there is no Pyodide at ${place}: put one there, or name its place in page.json`);
  });
  const python = await loadPyodide({ indexURL, env: { HOME: '/home/pyodide' }, stdout: print, stderr: print });
  const abi = python.runPython(ABI);
  if (!page.abis.includes(abi)) {
    throw new Error(`this page was built for Pyodide with ABI ${page.abis.join(' or ')}, not for ${python.version} `
      + `with ABI ${abi}: take such a Pyodide, or build the page with a carom that knows this one`);
  }
  say('loading numpy');
  await python.loadPackage('numpy', { messageCallback: () => {}, errorCallback: () => {} }).catch(() => {});
  if (!python.runPython('import importlib.util; importlib.util.find_spec("numpy") is not None')) {
    throw new Error(`the Pyodide at ${place} has no numpy, which carom needs: take one that comes with its packages`);
  }
  say('loading the game');
  python.unpackArchive(await read('game.zip'), 'zip', { extractDir: '/game' });
  python.runPython('import sys; sys.path.insert(0, "/game")');
  return python;
}

// Where there is none it is older than any that is known here: then the version of Emscripten tells it.
const ABI = 'import sysconfig, platform; sysconfig.get_config_var("PYODIDE_ABI_VERSION") or platform.release()';

// What a player can tell the game's maker, in one line: of a traceback the error itself, with its notes, and the last
// line of the game's own files that it came through.
export function reason(error) {
  const lines = String(error.message ?? error).trim().split('\n');
  const own = /^ +File "\/game\/((?!carom\/|esper\/|carom_page)[^"]+)", line (\d+)/;
  const where = lines.map((line) => line.match(own)).filter(Boolean).at(-1);
  const said = lines.slice(lines.findLastIndex((line) => line.startsWith('  ')) + 1).join('; ');
  return where ? `${where[1]}, line ${where[2]}: ${said}` : said;
}
