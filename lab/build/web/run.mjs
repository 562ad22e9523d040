// Runs the page of this folder without a browser: node run.mjs PYODIDE [SCRIPT.py], where PYODIDE is a folder with
// Pyodide and numpy. Runs the game as python does, or that script; exit code 1 and one line if it fails.
import fs from 'node:fs';
import path from 'node:path';
import { fileURLToPath, pathToFileURL } from 'node:url';
import { load, reason } from './loader.mjs';

const folder = path.dirname(fileURLToPath(import.meta.url));
const [pyodide, script] = process.argv.slice(2).map((name) => path.resolve(name));
try {
  if (!pyodide) throw new Error('node run.mjs PYODIDE [SCRIPT.py]: name a folder with Pyodide and numpy');
  const read = async (name) => new Uint8Array(fs.readFileSync(path.join(folder, name)));
  const page = JSON.parse(fs.readFileSync(path.join(folder, 'page.json'), 'utf8'));
  const place = `${pathToFileURL(pyodide).href}/`;
  const python = await load(page, place, pyodide + path.sep, read, () => {}, (line) => console.log(line));
  if (script) python.runPython(fs.readFileSync(script, 'utf8'), { filename: script });
  else python.runPython(`import runpy; runpy.run_path("/game/${page.game}.py", run_name="__main__"); None`);
} catch (error) {
  console.error(reason(error));
  process.exit(1);
}
