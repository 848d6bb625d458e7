/* What is counted of indirect light. */
void count_ray(LspHit hit) {
  atomicAdd(statistics[region.part].rays, 1u);
  if ((hit.flags & LSP_HIT_INCOMPLETE) != 0u) atomicAdd(statistics[region.part].incomplete, 1u);
}

void count_steps(uint steps) { atomicAdd(statistics[region.part].steps, steps); }
