// What programs write is there whole, or not at all.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "lsp/output_file.h"
#include "lsp/program.h"
#include "temporary_folder.h"

namespace lsp::test {
namespace {

namespace fs = std::filesystem;

class OutputFiles : public testing::Test {
 protected:
  fs::path at(const char* name) const { return folder_.path() / name; }
  std::ptrdiff_t count() const {
    return std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator());
  }
  static Exit exit_of(const std::function<void()>& body) {
    try {
      body();
    } catch (const Failure& failure) {
      return failure.exit();
    }
    return Exit::kDone;
  }

  TemporaryFolder folder_;
};

// The name that a file has until it is whole is no longer than its own.
TEST_F(OutputFiles, TheLongestNameIsTaken) {
  const fs::path longest = folder_.path() / (std::string(251, 'x') + ".lsp");
  const fs::path longer = folder_.path() / (std::string(252, 'x') + ".lsp");
  EXPECT_EQ(exit_of([&] { check_output(longest); }), Exit::kDone);
  EXPECT_EQ(exit_of([&] { write_file(longest, "whole"); }), Exit::kDone);
  EXPECT_EQ(read_bytes(longest), "whole");
  EXPECT_EQ(count(), 1);
  EXPECT_EQ(exit_of([&] { check_output(longer); }), Exit::kFile) << "before the work";
}

TEST_F(OutputFiles, AnOlderOneIsWholeUntilTheNewOneIs) {
  write_file(at("a"), "old");
  {
    OutputFile file(at("a"));
    file.write("new", 3);
    file.pad_to(8);
    file.finish();
    EXPECT_EQ(read_bytes(at("a")), "old");
  }
  EXPECT_EQ(read_bytes(at("a")), "old");
  OutputFile file(at("a"));
  file.write("new", 3);
  file.commit();
  EXPECT_EQ(read_bytes(at("a")), "new");
  EXPECT_EQ(count(), 1);
  struct stat status {};
  ASSERT_EQ(stat(at("a").c_str(), &status), 0);
  const mode_t mask = umask(0);
  umask(mask);
  EXPECT_EQ(status.st_mode & 0777, 0666 & ~mask);
}

// Even by what no program can prepare for.
TEST_F(OutputFiles, AKilledRunLeavesNothing) {
  const int nameless = open(folder_.path().c_str(), O_TMPFILE | O_WRONLY, 0600);
  if (nameless < 0) GTEST_SKIP() << "this file system knows no files without a name";
  close(nameless);
  for (const bool finished : {false, true}) {
    const pid_t child = fork();
    if (child == 0) {
      OutputFile file(at("a"));
      file.write("half", 4);
      if (finished) file.finish();
      kill(getpid(), SIGKILL);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(count(), 0);
  }
}

TEST_F(OutputFiles, MoreMayWaitThanThereAreDescriptors) {
  constexpr int kFiles = 450;
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit few{400, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  std::vector<std::unique_ptr<OutputFile>> files;
  for (int i = 0; i < kFiles; ++i) {
    files.push_back(std::make_unique<OutputFile>(at(std::to_string(i).c_str())));
    files.back()->write("x", 1);
    files.back()->finish();
  }
  for (const auto& file : files) file->commit();
  EXPECT_EQ(count(), kFiles);
  setrlimit(RLIMIT_NOFILE, &before);
}

TEST_F(OutputFiles, LinksAreFollowed) {
  fs::create_directory(at("folder"));
  write_file(at("folder/a"), "old");
  fs::create_symlink("folder/a", at("link"));
  write_file(at("link"), "new");
  EXPECT_TRUE(fs::is_symlink(at("link")));
  EXPECT_EQ(read_bytes(at("folder/a")), "new");
}

TEST_F(OutputFiles, PipesAndDevicesStayWhatTheyAre) {
  ASSERT_EQ(mkfifo(at("pipe").c_str(), 0600), 0);
  std::string came;
  std::thread reader([&] { came = read_bytes(at("pipe")); });
  check_output(at("pipe"));
  write_file(at("pipe"), "through");
  reader.join();
  EXPECT_EQ(came, "through");
  EXPECT_TRUE(fs::is_fifo(at("pipe")));

  fs::create_symlink("/dev/full", at("full"));
  EXPECT_EQ(exit_of([&] { write_file(at("full"), "x"); }), Exit::kFile);
  EXPECT_TRUE(fs::is_symlink(at("full")));
  EXPECT_TRUE(fs::is_character_file(at("full")));
}

TEST_F(OutputFiles, WhatCannotBeWrittenIsSaidBeforeTheWork) {
  write_file(at("a"), "input");
  fs::create_symlink("a", at("link"));
  const std::vector<fs::path> inputs = {at("missing"), at("a")};
  EXPECT_EQ(exit_of([&] { check_output(at("b"), inputs); }), Exit::kDone);
  EXPECT_EQ(exit_of([&] { check_output(at("a"), inputs); }), Exit::kUsage) << "it is read";
  EXPECT_EQ(exit_of([&] { check_output(at("link"), inputs); }), Exit::kUsage);
  EXPECT_EQ(exit_of([&] { check_output(folder_.path()); }), Exit::kFile) << "it is a folder";
  EXPECT_EQ(exit_of([&] { check_output(at("no/b")); }), Exit::kFile) << "there is no such folder";
}

}  // namespace
}  // namespace lsp::test
