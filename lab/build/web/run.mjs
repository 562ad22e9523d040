// Runs a page's folder without a browser: node run.mjs FOLDER PYODIDE SCRIPT.py, where PYODIDE is a folder with Pyodide
// and numpy; prints what the script prints. Exit code 1 and one line if it fails.
import fs from 'node:fs';
import path from 'node:path';
import { pathToFileURL } from 'node:url';
import { load, reason } from './loader.mjs';

const [folder, pyodide, script] = process.argv.slice(2).map((name) => path.resolve(name));
try {
  const read = async (name) => new Uint8Array(fs.readFileSync(path.join(folder, name)));
  const { loadPyodide } = await import(pathToFileURL(path.join(pyodide, 'pyodide.mjs')));
  const python = await load(loadPyodide, pyodide + path.sep, read, () => {});
  python.setStdout({ batched: (line) => console.log(line) });
  python.runPython(fs.readFileSync(script, 'utf8'));
} catch (error) {
  console.error(reason(error));
  process.exit(1);
}
