#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "import/gltf_draco.h"
#include "import/source_file.h"
#include "lsp/program.h"

#if defined(__SANITIZE_ADDRESS__)
#define LSP_ADDRESS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define LSP_ADDRESS_SANITIZER 1
#endif
#endif

namespace lsp {
namespace {

// Processor time for all primitives of a file: ten times what a hundred million triangles take.
constexpr rlim_t kSeconds = 120;

// On the pipe, for each primitive: Exit::kDone and its arrays, or another exit code and a text. An array is
// its number of elements and these.
struct Answer {
  uint64_t exit = 0;
  uint64_t reason_bytes = 0;
};

bool write_all(int fd, const void* data, size_t size) {
  const char* from = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t done = write(fd, from, size);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    from += done;
    size -= size_t(done);
  }
  return true;
}

bool read_all(int fd, void* data, size_t size) {
  char* to = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t done = read(fd, to, size);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) return false;
    to += done;
    size -= size_t(done);
  }
  return true;
}

// The pages this process has mapped, by the kernel's count.
uint64_t mapped_bytes() {
  unsigned long long pages = 0;
  if (std::FILE* statm = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(statm, "%llu", &pages) != 1) pages = 0;
    std::fclose(statm);
  }
  return pages * uint64_t(sysconf(_SC_PAGE_SIZE));
}

void limit(int resource, rlim_t value) {
  const rlimit both{value, value};
  setrlimit(static_cast<__rlimit_resource>(resource), &both);
}

// The child: decodes, answers, and ends without running anything of the parent's.
[[noreturn]] void serve(int fd, const std::string& file, std::span<const DracoJob> jobs, Budget& budget,
                        uint64_t mapped) {
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_CPU, kSeconds);
#ifndef LSP_ADDRESS_SANITIZER  // which maps terabytes
  limit(RLIMIT_AS, mapped + budget.left());
#else
  (void)mapped;
#endif
  for (const DracoJob& job : jobs) {
    Answer answer;
    std::string reason;
    DracoMesh mesh;
    try {
      mesh = decode_draco(file, job, budget);
    } catch (const Failure& failure) {
      answer.exit = uint64_t(failure.exit());
      reason = failure.what();
    } catch (const std::bad_alloc&) {
      answer.exit = uint64_t(Exit::kLimit);
      reason =
          "has KHR_draco_mesh_compression data that need more memory than the limit, raise --memory-limit";
    } catch (const std::exception&) {
      answer.exit = uint64_t(Exit::kInvalid);
      reason = "has KHR_draco_mesh_compression data that cannot be decoded, export it again";
    }
    answer.reason_bytes = answer.exit ? reason.size() : 0;
    bool good = write_all(fd, &answer, sizeof answer) && write_all(fd, reason.data(), answer.reason_bytes);
    const auto send = [&](const auto& vector) {
      const uint64_t size = vector.size();
      good =
          good && write_all(fd, &size, sizeof size) && write_all(fd, vector.data(), size * sizeof vector[0]);
    };
    if (!answer.exit) {
      send(mesh.indices);
      for (const auto& values : mesh.values) send(values);
    }
    if (!good || answer.exit) break;
  }
  _exit(0);
}

// One answer of the child, which hostile bytes may have made say anything. False where it said nothing more.
bool receive(int fd, const std::string& file, const DracoJob& job, Budget& budget, DracoMesh& mesh) {
  Answer answer;
  if (!read_all(fd, &answer, sizeof answer)) return false;
  if (answer.exit) {
    std::string reason(std::min<uint64_t>(answer.reason_bytes, 4096), '\0');
    if (!read_all(fd, reason.data(), reason.size())) return false;
    const bool known = answer.exit == uint64_t(Exit::kLimit) || answer.exit == uint64_t(Exit::kUnsupported);
    throw Failure(known ? Exit(int(answer.exit)) : Exit::kInvalid, file, printable(reason));
  }
  const auto fill = [&](auto& vector, uint64_t components) {
    uint64_t size = 0;
    if (!read_all(fd, &size, sizeof size) || size % components != 0) return false;
    budget.charge(file, size, sizeof vector[0]);
    vector.resize(size);
    return read_all(fd, vector.data(), size * sizeof vector[0]);
  };
  if (!fill(mesh.indices, 3)) return false;
  for (const DracoAttribute& attribute : job.attributes) {
    if (!fill(mesh.values.emplace_back(), uint64_t(attribute.components))) return false;
  }
  return true;
}

}  // namespace

std::vector<DracoMesh> decode_draco_fenced(const std::string& file, std::span<const DracoJob> jobs,
                                           Budget& budget) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw Failure(Exit::kInternal, file, "no pipe to its decoder");
  const uint64_t mapped = mapped_bytes();
  const pid_t child = fork();
  if (child == 0) {
    close(ends[0]);
    signal(SIGPIPE, SIG_IGN);
    serve(ends[1], file, jobs, budget, mapped);
  }
  close(ends[1]);

  // On every way out the child is ended and collected.
  struct Child {
    pid_t pid;
    int fd, status = 0;
    bool collected = false;
    void collect() {
      if (collected || pid < 0) return;
      collected = true;
      while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
      }
    }
    ~Child() {
      close(fd);
      if (pid > 0 && !collected) kill(pid, SIGKILL);
      collect();
    }
  } process{child, ends[0]};
  if (child < 0) throw Failure(Exit::kLimit, file, "needs a process of its own to decode, and there is none");

  std::vector<DracoMesh> meshes(jobs.size());
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (receive(process.fd, file, jobs[i], budget, meshes[i])) continue;
    process.collect();
    const bool slow = WIFSIGNALED(process.status) &&
                      (WTERMSIG(process.status) == SIGXCPU || WTERMSIG(process.status) == SIGKILL);
    throw Failure(slow ? Exit::kLimit : Exit::kInvalid, file,
                  slow ? "has KHR_draco_mesh_compression data that take too much time or memory to decode, "
                         "export it without"
                       : "has KHR_draco_mesh_compression data that crash the decoder, export it again");
  }
  return meshes;
}

}  // namespace lsp
