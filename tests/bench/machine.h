// What the figures were measured on.
#pragma once

#include "report.h"

namespace lsp::bench {

// Processor, cores, caches, memory, system, compiler, versions, time of day, load before the run.
Json machine_facts();

// Load average over the last minute: above a fraction of one, somebody else is using the machine.
double machine_load();

}  // namespace lsp::bench
