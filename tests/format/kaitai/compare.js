// The second reader: lsp.ksy compiled to JavaScript reads every valid file of the corpus, and must find the
// values that the C++ reader finds.
//
//   node compare.js LSP.KSY C++-DUMP-PROGRAM FILE.lsp...
'use strict';
const assert = require('assert');
const fs = require('fs');
const { execFileSync } = require('child_process');
const compiler = require('kaitai-struct-compiler');
const KaitaiStream = require('kaitai-struct/KaitaiStream');
const yaml = require('yaml');
const fzstd = require('fzstd');

// What lsp.ksy calls zstd_frame: a whole frame that unfolds to so many bytes.
class ZstdFrame {
  constructor(bytes) { this.bytes = bytes; }
  decode(frame) {
    const data = fzstd.decompress(frame);
    assert.strictEqual(data.length, Number(this.bytes), 'a frame of another size');
    return data;
  }
}

async function compile(path) {
  const description = yaml.parse(fs.readFileSync(path, 'utf8'));
  const files = await compiler.compile('javascript', description, null, false);
  const module_ = { exports: {} };
  new Function('module', 'exports', 'require', files['Lsp.js'])(module_, module_.exports, (name) => (name.endsWith('ZstdFrame') ? { ZstdFrame } : require(name)));
  return module_.exports.Lsp || module_.exports;
}

const wide = new Set(['origin_x', 'origin_y', 'origin_z', 'file_bytes', 'section_table_offset', 'primitive_count', 'offset', 'stored_bytes', 'bytes', 'element_count']);
const floats = new Set(['cells_size', 'cells_per_size', 'cells_margin', 'cells_box_step', 'distance', 'normal_angle_cos', 'plane_tolerance', 'ntree_size', 'ntree_margin', 'opacity', 'roughness', 'metallic', 'x', 'y', 'z']);

// headerBytes becomes header_bytes; the compiler drops the underscore before a digit.
const snake = (name) => name.replace(/([A-Z])/g, '_$1').replace(/^(reserved|box)(\d)$/, '$1_$2').toLowerCase();
const bits = (value) => new Uint32Array(new Float32Array([value]).buffer)[0];
const hex = (bytes) => Buffer.from(bytes).toString('hex');

// What a value of the description looks like in the dump; `owner` is the name of the type that holds it.
function plain(value, name, owner) {
  if (value instanceof Uint8Array) return hex(value);
  if (Array.isArray(value)) return value.map((v) => plain(v, name, owner));
  if (value !== null && typeof value === 'object') {
    switch (value.constructor.name) {
      case 'Vec3': return [bits(value.x), bits(value.y), bits(value.z)];
      case 'ChildReference':
      case 'CellReference':
      case 'LineSpaceReference':
      case 'LineSpaceFormat': return value.value;
      case 'Octahedral': return ((value.x & 0xffff) | (value.y << 16)) >>> 0;
      default: return fields(value);
    }
  }
  if (floats.has(name)) return bits(value);
  // A bit word's offset has 32 bits, a section's 64.
  if (wide.has(name) && owner !== 'BitWord') return String(value);
  return value;
}

function fields(object) {
  const result = {};
  for (const key of Object.keys(object)) {
    if (key.startsWith('_') || typeof object[key] === 'function') continue;
    const name = snake(key);
    result[name] = plain(object[key], name, object.constructor.name);
  }
  return result;
}

function dump(Lsp, path) {
  const lsp = new Lsp(new KaitaiStream(fs.readFileSync(path)));
  const sections = lsp.sections.map((section) => {
    const result = fields(section);
    const packed = section.codec !== 0;
    const body = packed ? section.unpackedBody : section.body;
    if (packed || body instanceof Uint8Array) result.stored = hex(section.stored);
    if (body instanceof Uint8Array) {
      // A section of no known type.
    } else if (body.elements !== undefined) {
      result.elements = body.elements.map(fields);
    } else if (body.words !== undefined) {
      result.words = body.words;
    } else {
      result.json = body.json;
    }
    return result;
  });
  return { header: fields(lsp.header), sections };
}

async function main() {
  const [ksy, program, ...files] = process.argv.slice(2);
  const Lsp = await compile(ksy);
  let values = 0;
  const count = (v) => (v !== null && typeof v === 'object' ? Object.values(v).forEach(count) : (values += 1));
  for (const file of files) {
    const mine = dump(Lsp, file);
    const theirs = JSON.parse(execFileSync(program, [file], { maxBuffer: 1 << 28, encoding: 'utf8' }));
    assert.deepStrictEqual(mine, theirs, file);
    count(mine);
  }
  assert(files.length > 0 && values > 1000, 'nothing was compared');
  console.log(`${files.length} files, ${values} values, all equal`);
}

main().catch((error) => {
  console.error(error.message || error);
  process.exit(1);
});
