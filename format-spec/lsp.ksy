meta:
  id: lsp
  title: Precomputed Line Spaces
  file-extension: lsp
  endian: le
  license: MIT
doc: |
  A scene of triangles, a tree over them, and Line Spaces: tables that answer what a ray through a box hits.
  The normative text is SPEC.md. A packed section is one zstd frame, for which Kaitai Struct has no process of its
  own: zstd_frame(bytes) stands for a decompressor that returns so many bytes.
seq:
  - id: header
    type: header
  - id: sections
    type: section
    repeat: expr
    repeat-expr: header.section_count
enums:
  section_type:
    0x45444f4e: node
    0x41495254: tria
    0x4c4d524e: nrml
    0x4c54414d: matl
    0x4350534c: lspc
    0x53544942: bits
    0x444e4143: cand
    0x44495247: grid
    0x4c4c4543: cell
    0x53464552: refs
    0x444f4e57: wnod
    0x44524743: cgrd
    0x544c4543: celt
    0x544e4543: cent
    0x4e4c5043: cpln
    0x43525043: cprc
    0x4c505343: cspl
    0x444f4e43: cnod
    0x46455243: cref
    0x4154454d: meta
  codec:
    0: none
    1: zstd
  base_structure:
    1: bvh
    2: ntree
    3: cells
    4: wide
types:
  vec3:
    seq:
      - id: x
        type: f4
      - id: y
        type: f4
      - id: z
        type: f4
  header:
    seq:
      - id: magic
        contents: [0x89, 0x4c, 0x53, 0x50, 0x0d, 0x0a, 0x1a, 0x0a]
      - id: version_major
        type: u4
        valid: 2
      - id: version_minor
        type: u4
      - id: header_bytes
        type: u4
        valid: 384
      - id: section_count
        type: u4
      - id: required_features
        type: u4
      - id: optional_features
        type: u4
      - id: file_bytes
        type: u8
      - id: section_table_offset
        type: u8
        valid: 384
      - id: alignment
        type: u4
      - id: base_structure
        type: u4
        enum: base_structure
      - id: primitive_count
        type: u8
      - id: content_hash
        size: 16
        doc: content_hash_lo, content_hash_hi
      - id: header_hash
        size: 16
      - id: bounds_min
        type: vec3
      - id: normal_angle_cos
        type: f4
      - id: bounds_max
        type: vec3
      - id: plane_tolerance
        type: f4
      - id: root
        type: child_reference
      - id: root_line_space
        type: line_space_reference
      - id: node_count
        type: u4
      - id: triangle_count
        type: u4
      - id: line_space_count
        type: u4
      - id: bit_word_count
        type: u4
      - id: candidate_word_count
        type: u4
      - id: material_count
        type: u4
      - id: max_depth
        type: u4
      - id: max_stack
        type: u4
      - id: max_steps
        type: u4
      - id: max_leaf_triangles
        type: u4
      - id: resolution
        type: u4
      - id: line_space_depth
        type: u4
      - id: line_space_triangles
        type: u4
      - id: ntree_branching
        type: u4
      - id: ntree_depth
        type: u4
      - id: reserved_0
        type: u4
      - id: source_hash
        size: 16
      - id: cell_count
        type: u4
      - id: reference_count
        type: u4
      - id: ntree_lo
        type: vec3
      - id: ntree_size
        type: f4
      - id: ntree_margin
        type: f4
      - id: quality_part
        type: u4
        repeat: expr
        repeat-expr: 3
      - id: cells_lo
        type: vec3
      - id: cells_size
        type: f4
      - id: cells_cells_x
        type: u4
      - id: cells_cells_y
        type: u4
      - id: cells_cells_z
        type: u4
      - id: cells_per_size
        type: f4
      - id: cells_margin
        type: f4
      - id: cells_box_step
        type: f4
      - id: cells_far_patches
        type: u4
      - id: cells_origin_patches
        type: u4
      - id: cells_sub_cells
        type: u4
      - id: cells_origin_entry_first
        type: u4
      - id: cells_reserved
        type: u4
        repeat: expr
        repeat-expr: 2
      - id: origin_x
        type: u8
        doc: float64
      - id: origin_y
        type: u8
        doc: float64
      - id: origin_z
        type: u8
        doc: float64
      - id: filled_cell_count
        type: u4
      - id: entry_word_count
        type: u4
      - id: plane_count
        type: u4
      - id: split_count
        type: u4
      - id: cell_node_count
        type: u4
      - id: cell_reference_count
        type: u4
      - id: quality
        type: u4
        repeat: expr
        repeat-expr: 3
      - id: wide_node_count
        type: u4
  section:
    seq:
      - id: type
        type: u4
        enum: section_type
      - id: flags
        type: u4
      - id: offset
        type: u8
      - id: stored_bytes
        type: u8
      - id: bytes
        type: u8
      - id: codec
        type: u4
        enum: codec
      - id: element_bytes
        type: u4
      - id: element_count
        type: u8
      - id: hash
        size: 16
    instances:
      required:
        value: (flags & 1) != 0
      stored:
        io: _root._io
        pos: offset
        size: stored_bytes
      body:
        io: _root._io
        pos: offset
        size: stored_bytes
        if: codec == codec::none
        type: &content
          switch-on: type
          cases:
            'section_type::node': nodes
            'section_type::tria': triangles
            'section_type::nrml': corner_normals
            'section_type::matl': materials
            'section_type::lspc': line_spaces
            'section_type::bits': bit_words
            'section_type::cand': words
            'section_type::grid': bit_words
            'section_type::cell': cells
            'section_type::refs': words
            'section_type::wnod': wide_nodes
            'section_type::cgrd': words
            'section_type::celt': filled_cells
            'section_type::cent': words
            'section_type::cpln': planes
            'section_type::cprc': words
            'section_type::cspl': splits
            'section_type::cnod': cell_nodes
            'section_type::cref': words
            'section_type::meta': provenance
      unpacked_body:
        io: _root._io
        pos: offset
        size: stored_bytes
        process: zstd_frame(bytes)
        if: codec == codec::zstd
        type: *content
  child_reference:
    doc: Of a BVH. An NTree's Line Spaces repeat the value of a cell_reference in this place.
    seq:
      - id: value
        type: u4
    instances:
      is_none:
        value: value == 0xffffffff
      is_leaf:
        value: value >= 0x80000000 and value != 0xffffffff
      node:
        value: value
        if: value < 0x80000000
      first_triangle:
        value: value & 0x7ffffff
        if: is_leaf
      triangle_count:
        value: ((value >> 27) & 15) + 1
        if: is_leaf
  cell_reference:
    doc: Of a cell of an NTree. The number of a leaf's references stands beside it.
    seq:
      - id: value
        type: u4
    instances:
      is_none:
        value: value == 0xffffffff
      is_leaf:
        value: value >= 0x80000000 and value != 0xffffffff
      node:
        value: value
        if: value < 0x80000000
      first_reference:
        value: value & 0x7fffffff
        if: is_leaf
  line_space_reference:
    seq:
      - id: value
        type: u4
    instances:
      is_none:
        value: value == 0xffffffff
      is_terminal:
        value: value >= 0x80000000 and value != 0xffffffff
      index:
        value: value & 0x7fffffff
        if: value != 0xffffffff
  nodes:
    seq:
      - id: elements
        type: node
        repeat: eos
  node:
    seq:
      - id: lo0
        type: vec3
      - id: child0
        type: child_reference
      - id: hi0
        type: vec3
      - id: line_space0
        type: line_space_reference
      - id: lo1
        type: vec3
      - id: child1
        type: child_reference
      - id: hi1
        type: vec3
      - id: line_space1
        type: line_space_reference
  cells:
    seq:
      - id: elements
        type: cell
        repeat: eos
  cell:
    seq:
      - id: child
        type: cell_reference
      - id: count
        type: u4
      - id: line_space
        type: line_space_reference
  triangles:
    seq:
      - id: elements
        type: triangle
        repeat: eos
  triangle:
    seq:
      - id: v0
        type: vec3
      - id: primitive
        type: u4
      - id: v1
        type: vec3
      - id: material
        type: u4
      - id: v2
        type: vec3
      - id: flags
        type: u4
        doc: Bit 0 is SMOOTH; bits 16 to 31 are the gaps, so many of 65536 rays pass.
  corner_normals:
    seq:
      - id: elements
        type: corner_normal
        repeat: eos
  octahedral:
    seq:
      - id: x
        type: s2
      - id: y
        type: s2
  corner_normal:
    seq:
      - id: n0
        type: octahedral
      - id: n1
        type: octahedral
      - id: n2
        type: octahedral
  materials:
    seq:
      - id: elements
        type: material
        repeat: eos
  material:
    seq:
      - id: base_color
        type: vec3
      - id: opacity
        type: f4
      - id: emission
        type: vec3
      - id: roughness
        type: f4
      - id: metallic
        type: f4
      - id: reserved
        type: u4
        repeat: expr
        repeat-expr: 3
  line_spaces:
    seq:
      - id: elements
        type: line_space
        repeat: eos
  line_space:
    seq:
      - id: lo
        type: vec3
      - id: word_first
        type: u4
      - id: hi
        type: vec3
      - id: candidate_first
        type: u4
      - id: scale
        type: vec3
      - id: triangle_first
        type: u4
      - id: format
        type: line_space_format
      - id: filled
        type: u4
      - id: triangle_count
        type: u4
      - id: child
        type: child_reference
  line_space_format:
    seq:
      - id: value
        type: u4
    instances:
      resolution:
        value: value & 0xff
      entry_bytes:
        value: (value >> 8) & 15
      is_dense:
        value: (value & 0x1000) != 0
      is_symmetric:
        value: (value & 0x2000) != 0
      shaft_count:
        value: '(is_symmetric ? 15 : 30) * resolution * resolution * resolution * resolution'
  bit_words:
    seq:
      - id: elements
        type: bit_word
        repeat: eos
  bit_word:
    seq:
      - id: bits
        type: u4
      - id: offset
        type: u4
  filled_cells:
    seq:
      - id: elements
        type: filled_cell
        repeat: eos
  filled_cell:
    seq:
      - id: sub_mask_lo
        type: u4
      - id: sub_mask_hi
        type: u4
      - id: sub_first
        type: u4
      - id: closed
        type: u4
      - id: plane_first
        type: u4
      - id: plane_count
        type: u4
      - id: split_first
        type: u4
      - id: split_count
        type: u4
      - id: root
        type: u4
      - id: node_first
        type: u4
      - id: reference_first
        type: u4
      - id: max_steps
        type: u4
  planes:
    seq:
      - id: elements
        type: plane
        repeat: eos
  plane:
    seq:
      - id: normal
        type: vec3
      - id: distance
        type: f4
  splits:
    seq:
      - id: elements
        type: split
        repeat: eos
  split:
    seq:
      - id: answers
        type: u4
      - id: weights
        type: u4
  cell_nodes:
    seq:
      - id: elements
        type: cell_node
        repeat: eos
  cell_node:
    seq:
      - id: box_0
        type: u4
      - id: box_1
        type: u4
      - id: box_2
        type: u4
      - id: children
        type: u4
  wide_nodes:
    seq:
      - id: elements
        type: wide_node
        repeat: eos
  wide_node:
    seq:
      - id: lo
        type: vec3
      - id: node_first
        type: u4
      - id: step
        type: vec3
      - id: triangle_first
        type: u4
      - id: children
        type: u4
        repeat: expr
        repeat-expr: 4
        doc: |
          Two children in a word, the lower half first: ffff is none; with bit 15 the rest counts from node_first; else
          a leaf of bits 11 to 14 plus 1 triangles, the first counted from triangle_first in bits 0 to 10.
      - id: planes
        type: u4
        repeat: expr
        repeat-expr: 12
        doc: lo x, y, z, hi x, y, z in steps from lo; of each a byte a child, child 0 lowest, in two words.
  words:
    doc: Candidate entries of 1, 2 or 4 bytes, packed; or indices of triangles.
    seq:
      - id: words
        type: u4
        repeat: eos
  provenance:
    seq:
      - id: json
        type: str
        size-eos: true
        encoding: UTF-8
