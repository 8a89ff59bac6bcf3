#include "mapjoin/joining/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>

#include "mapjoin/graph/error.h"
#include "mapjoin/joining/report.h"

namespace mapjoin {

namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kFormat = 0x314b43706a6d616dULL;  // "mapjpCK1"
constexpr std::string_view kPrefix = "subtree_";
constexpr std::string_view kSuffix = ".mapjoin";

/// A word-wise FNV-1a: what differs by accident differs here.
class Hash {
 public:
  void add(std::uint64_t word) { state_ = (state_ ^ word) * 0x100000001b3ULL ^ (state_ >> 29); }
  template <class T>
  void add(const std::vector<T>& values) {
    add(static_cast<std::uint64_t>(values.size()));
    add(values.data(), values.size() * sizeof(T));
  }
  void add(const void* data, std::size_t bytes) {
    const auto* from = static_cast<const unsigned char*>(data);
    for (; bytes >= 8; from += 8, bytes -= 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, from, 8);
      add(word);
    }
    std::uint64_t rest = bytes;
    std::memcpy(&rest, from, bytes);
    add(rest);
  }
  std::uint64_t value() const { return state_; }

 private:
  std::uint64_t state_ = 0xcbf29ce484222325ULL;
};

/// A file's contents: arrays, each after its length.
class Packer {
 public:
  template <class T>
  void add(const std::vector<T>& values) {
    add_word(values.size());
    const auto* bytes = reinterpret_cast<const char*>(values.data());
    bytes_.insert(bytes_.end(), bytes, bytes + values.size() * sizeof(T));
  }
  void add_word(std::uint64_t word) {
    const auto* bytes = reinterpret_cast<const char*>(&word);
    bytes_.insert(bytes_.end(), bytes, bytes + sizeof word);
  }
  const std::vector<char>& bytes() const { return bytes_; }

 private:
  std::vector<char> bytes_;
};

class Unpacker {
 public:
  explicit Unpacker(const std::vector<char>& bytes) : bytes_(bytes) {}
  std::uint64_t word() {
    std::uint64_t out = 0;
    take(&out, sizeof out);
    return out;
  }
  template <class T>
  void take(std::vector<T>& values) {
    const std::uint64_t size = word();
    if (size > (bytes_.size() - at_) / sizeof(T)) throw InputError("it is cut short");
    values.resize(size);
    take(values.data(), size * sizeof(T));
  }

 private:
  void take(void* to, std::size_t bytes) {
    if (bytes > bytes_.size() - at_) throw InputError("it is cut short");
    if (bytes > 0) std::memcpy(to, bytes_.data() + at_, bytes);
    at_ += bytes;
  }

  const std::vector<char>& bytes_;
  std::size_t at_ = 0;
};

std::optional<int> node_of(const fs::path& file) {
  const std::string name = file.filename().string();
  if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) return std::nullopt;
  const char* const end = name.data() + name.size() - kSuffix.size();
  int node = -1;
  const auto [stopped, error] = std::from_chars(name.data() + kPrefix.size(), end, node);
  if (error != std::errc() || stopped != end || node < 0) return std::nullopt;
  return node;
}

std::vector<char> read_all(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::vector<char> out((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (!in.good() && !in.eof())
    throw Error(fmt::format("cannot read {}: {}", path.string(), std::strerror(errno)));
  return out;
}

/// Format, fingerprint, checksum of what follows.
constexpr std::size_t kHeader = 3 * sizeof(std::uint64_t);

std::uint64_t word_at(const std::vector<char>& bytes, std::size_t k) {
  std::uint64_t out = 0;
  if (bytes.size() >= (k + 1) * sizeof out)
    std::memcpy(&out, bytes.data() + k * sizeof out, sizeof out);
  return out;
}

}  // namespace

template <int D>
std::uint64_t fingerprint(const MeasurementGraph<D>& graph, const JoinOptions& options) {
  Hash hash;
  for (const auto& column : graph.variables.columns()) {
    hash.add(column.kind->tag.bits());
    for (const Key& key : column.keys) {
      hash.add(key.session);
      hash.add(key.id);
    }
  }
  for (const auto& column : graph.relative) {
    hash.add(column.from);
    hash.add(column.to);
    hash.add(column.z);
    hash.add(column.info);
  }
  const auto& maps = graph.submaps;
  hash.add(maps.anchor_start);
  hash.add(maps.anchor_variables);
  hash.add(maps.term_start);
  hash.add(maps.term_variable);
  hash.add(maps.values);
  hash.add(maps.block_start);
  hash.add(maps.block_row);
  hash.add(maps.block_column);
  hash.add(maps.information);
  hash.add(static_cast<std::uint64_t>(D));
  hash.add(static_cast<std::uint64_t>(options.mode));
  hash.add(submap_sizes(options, graph.variables.size()));
  return hash.value();
}

template <int D>
Checkpoint<D>::Checkpoint(fs::path folder, std::uint64_t fingerprint)
    : folder_(std::move(folder)), fingerprint_(fingerprint) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error)
    throw Error(
        fmt::format("cannot make the checkpoint folder {}: {}", folder_.string(), error.message()));
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const std::optional<int> node = node_of(entry.path());
    if (!node) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    std::vector<char> header(kHeader);
    in.read(header.data(), static_cast<std::streamsize>(kHeader));
    if (word_at(header, 0) != kFormat || word_at(header, 1) != fingerprint_) {
      throw InputError(
          fmt::format("{} is the checkpoint of another run (other measurements or options); name "
                      "another folder, or delete this one",
                      folder_.string()));
    }
    saved_.push_back(*node);
  }
  std::sort(saved_.begin(), saved_.end());
}

template <int D>
fs::path Checkpoint<D>::file_of(int node) const {
  return folder_ / fmt::format("{}{}{}", kPrefix, node, kSuffix);
}

template <int D>
void Checkpoint<D>::save(int node, const std::vector<Piece<D>>& pieces) const {
  Packer packer;
  packer.add_word(pieces.size());
  for (const Piece<D>& piece : pieces) {
    packer.add(piece.variables);
    packer.add(piece.column_start);
    packer.add(piece.observations);
    packer.add_word(piece.data.size());
    for (const auto& column : piece.data) packer.add(column);
  }
  Hash checksum;
  checksum.add(packer.bytes());
  Packer header;
  header.add_word(kFormat);
  header.add_word(fingerprint_);
  header.add_word(checksum.value());

  const fs::path path = file_of(node);
  fs::path unfinished = path;
  unfinished += ".unfinished";
  {
    std::ofstream out(unfinished, std::ios::binary | std::ios::trunc);
    out.write(header.bytes().data(), static_cast<std::streamsize>(header.bytes().size()));
    out.write(packer.bytes().data(), static_cast<std::streamsize>(packer.bytes().size()));
    out.close();
    if (!out)
      throw Error(fmt::format("cannot write the checkpoint {}: {}; free some space, or go without",
                              path.string(), std::strerror(errno)));
  }
  fs::rename(unfinished, path);
}

template <int D>
std::vector<Piece<D>> Checkpoint<D>::load(int node) const {
  const fs::path path = file_of(node);
  const std::vector<char> file = read_all(path);
  try {
    if (file.size() < kHeader || word_at(file, 0) != kFormat || word_at(file, 1) != fingerprint_)
      throw InputError("it is of another run");
    const std::vector<char> contents(file.begin() + kHeader, file.end());
    Hash checksum;
    checksum.add(contents);
    if (checksum.value() != word_at(file, 2)) throw InputError("its checksum is wrong");
    Unpacker unpacker(contents);
    std::vector<Piece<D>> pieces(unpacker.word());
    for (Piece<D>& piece : pieces) {
      unpacker.take(piece.variables);
      unpacker.take(piece.column_start);
      unpacker.take(piece.observations);
      piece.data.resize(unpacker.word());
      for (auto& column : piece.data) unpacker.take(column);
    }
    return pieces;
  } catch (const InputError& error) {
    throw InputError(fmt::format("the checkpoint {} is damaged: {}; delete it and run again",
                                 path.string(), error.what()));
  }
}

template <int D>
void Checkpoint<D>::remove(int node) const {
  std::error_code ignored;  // a superfluous file does no harm
  fs::remove(file_of(node), ignored);
}

void remove_checkpoint(const fs::path& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    fs::path name = entry.path();
    if (name.extension() == ".unfinished") name.replace_extension();
    if (node_of(name)) fs::remove(entry.path(), ignored);
  }
  fs::remove(folder, ignored);  // fails, as it should, when there is something else in it
}

#define MAPJOIN_INSTANTIATE(D)                                                           \
  template std::uint64_t fingerprint<D>(const MeasurementGraph<D>&, const JoinOptions&); \
  template class Checkpoint<D>;
MAPJOIN_INSTANTIATE(2)
MAPJOIN_INSTANTIATE(3)
#undef MAPJOIN_INSTANTIATE

}  // namespace mapjoin
