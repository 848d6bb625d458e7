// The smallest shader that traces: one ray down the axis.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lsp/lsp.glsl"

layout(local_size_x = 1) in;
layout(std430, set = 0, binding = 7) buffer Answer { LspHit answer; };

void main() { answer = lsp_trace(lsp_bound_scene(), LspRay(vec3(0.0), 0.0, vec3(0.0, 0.0, 1.0), 1e30), 0u, 0.0); }
