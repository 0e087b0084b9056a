#include "compression.hpp"

#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

#include "rtpm/base/assert.hpp"

namespace rtpm::recording {
namespace {

/// Fast, because the recorder shares its CPUs with the recorded program.
constexpr int kZstdLevel = 1;

/// The highest compression ratios: a zstd block of 4 bytes for 128 KiB, an LZ4 length byte for 255
/// bytes. A chunk that claims more gets no memory.
constexpr std::size_t kZstdRatioMax = 32'768;
constexpr std::size_t kLz4RatioMax = 255;

bool is_possible(std::size_t size, ConstBytes compressed, std::size_t ratio_max) {
  return size / ratio_max <= compressed.size();
}

std::optional<std::vector<std::byte>> decompress_lz4(ConstBytes compressed, std::size_t size) {
  if (!is_possible(size, compressed, kLz4RatioMax)) return std::nullopt;
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return std::nullopt;
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owner(
      context, &LZ4F_freeDecompressionContext);
  std::vector<std::byte> bytes(size);
  std::size_t written = 0;
  while (!compressed.empty()) {
    std::size_t room = size - written;
    std::size_t taken = compressed.size();
    const std::size_t hint =
        LZ4F_decompress(context, bytes.data() + written, &room, compressed.data(), &taken, nullptr);
    if (LZ4F_isError(hint) || (taken == 0 && room == 0)) return std::nullopt;
    written += room;
    compressed = compressed.subspan(taken);
    if (hint == 0) break;
  }
  if (written != size) return std::nullopt;
  return bytes;
}

}  // namespace

std::string_view to_string(Compression compression) noexcept {
  switch (compression) {
    case Compression::kLz4:
      return "lz4";
    case Compression::kZstd:
      return "zstd";
    default:
      return "";
  }
}

void compress(Compression compression, ConstBytes bytes, std::vector<std::byte>& compressed) {
  std::size_t size = bytes.size();
  switch (compression) {
    case Compression::kNone:
      compressed.assign(bytes.begin(), bytes.end());
      return;
    case Compression::kLz4:
      compressed.resize(LZ4F_compressFrameBound(bytes.size(), nullptr));
      size = LZ4F_compressFrame(compressed.data(), compressed.size(), bytes.data(), bytes.size(),
                                nullptr);
      RTPM_ASSERT(!LZ4F_isError(size), "lz4 has room for all that it makes");
      break;
    case Compression::kZstd:
      compressed.resize(ZSTD_compressBound(bytes.size()));
      size = ZSTD_compress(compressed.data(), compressed.size(), bytes.data(), bytes.size(),
                           kZstdLevel);
      RTPM_ASSERT(!ZSTD_isError(size), "zstd has room for all that it makes");
      break;
  }
  compressed.resize(size);
}

std::optional<std::vector<std::byte>> decompress(std::string_view compression,
                                                 ConstBytes compressed, std::size_t size) {
  if (compression.empty()) {
    if (compressed.size() != size) return std::nullopt;
    return std::vector<std::byte>(compressed.begin(), compressed.end());
  }
  if (compressed.empty() && size == 0) return std::vector<std::byte>{};
  if (compression == "lz4") return decompress_lz4(compressed, size);
  if (compression != "zstd") return std::nullopt;
  // The size that the frame states, if any, so that a wrong size gets no memory either.
  const auto stated = ZSTD_getFrameContentSize(compressed.data(), compressed.size());
  const bool is_stated = stated != ZSTD_CONTENTSIZE_UNKNOWN;
  if (stated == ZSTD_CONTENTSIZE_ERROR || (is_stated && stated > size)) return std::nullopt;
  if (!is_possible(size, compressed, kZstdRatioMax)) return std::nullopt;
  std::vector<std::byte> bytes(size);
  const std::size_t written =
      ZSTD_decompress(bytes.data(), bytes.size(), compressed.data(), compressed.size());
  if (ZSTD_isError(written) || written != size) return std::nullopt;
  return bytes;
}

}  // namespace rtpm::recording
