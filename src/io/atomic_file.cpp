#include "mapjoin/io/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

#include "mapjoin/graph/error.h"

namespace mapjoin {

namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& target, int error) {
  throw FileError(
      fmt::format("cannot write '{}': {}; check the folder, its permissions and the space left",
                  target.string(), std::strerror(error)));
}

/// An open file, closed when it goes out of scope.
class Descriptor {
 public:
  Descriptor(const fs::path& path, int flags)
      : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  bool is_open() const { return fd_ >= 0; }
  bool write(std::string_view content) const {
    while (!content.empty()) {
      const ssize_t done = ::write(fd_, content.data(), content.size());
      if (done < 0 && errno == EINTR) continue;
      if (done < 0) return false;
      content.remove_prefix(static_cast<std::size_t>(done));
    }
    return true;
  }
  bool close() {
    const int fd = fd_;
    fd_ = -1;
    return fd < 0 || ::close(fd) == 0;
  }

 private:
  int fd_;
};

fs::path temporary_beside(const fs::path& target) {
  static std::atomic<unsigned> count{0};
  fs::path out = target;
  out += fmt::format(".tmp-{}-{}", ::getpid(), count++);
  return out;
}

void write_directly(const fs::path& target, std::string_view content) {
  Descriptor file(target, O_WRONLY);
  if (!file.is_open() || !file.write(content) || !file.close()) fail(target, errno);
}

}  // namespace

void write_atomically(const fs::path& given, std::string_view content) {
  std::error_code error;
  const fs::path target = fs::is_symlink(given, error) ? fs::weakly_canonical(given, error) : given;
  if (fs::is_directory(target, error)) fail(target, EISDIR);
  if (fs::exists(target, error)) {
    if (!fs::is_regular_file(target, error)) return write_directly(target, content);
    if (::access(target.c_str(), W_OK) != 0) fail(target, errno);
  }
  const fs::path temporary = temporary_beside(target);
  Descriptor file(temporary, O_WRONLY | O_CREAT | O_EXCL);
  if (!file.is_open()) fail(target, errno);
  if (file.write(content) && file.close() && ::rename(temporary.c_str(), target.c_str()) == 0)
    return;
  const int why = errno;
  file.close();
  ::unlink(temporary.c_str());
  fail(target, why);
}

}  // namespace mapjoin
