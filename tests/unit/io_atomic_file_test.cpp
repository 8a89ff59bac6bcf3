#include "mapjoin/io/atomic_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/io.h"

namespace mapjoin {
namespace {

TEST(AtomicFile, ReplacesTheTargetAndLeavesNothingElse) {
  const test::TemporaryDirectory folder;
  test::write_text(folder.file("a"), "old");
  write_atomically(folder.file("a"), "new");
  EXPECT_EQ(test::read_text(folder.file("a")), "new");
  EXPECT_EQ(test::files_in(folder.path()), 1);
}

TEST(AtomicFile, FailureLeavesNothingBehind) {
  const test::TemporaryDirectory folder;
  const std::string target = folder.file("missing/a");
  EXPECT_THAT(test::message_of<FileError>([&] { write_atomically(target, "x"); }),
              testing::HasSubstr("cannot write '" + target));
  std::filesystem::create_directory(folder.file("b"));
  EXPECT_THROW(write_atomically(folder.file("b"), "x"), FileError);
  EXPECT_EQ(test::files_in(folder.path()), 1);
}

TEST(AtomicFile, FollowsSymbolicLinks) {
  const test::TemporaryDirectory folder;
  test::write_text(folder.file("a"), "old");
  std::filesystem::create_symlink(folder.file("a"), folder.file("link"));
  write_atomically(folder.file("link"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("link")));
  EXPECT_EQ(test::read_text(folder.file("a")), "new");
}

TEST(AtomicFile, WritesDirectlyToWhatIsNoFile) {
  write_atomically("/dev/null", "x");
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
}

TEST(AtomicFile, FullDiskIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  EXPECT_THROW(write_atomically("/dev/full", "x"), FileError);
}

}  // namespace
}  // namespace mapjoin
