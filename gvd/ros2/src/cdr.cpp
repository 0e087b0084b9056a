#include "rtpm/ros2/cdr.hpp"

#include <array>
#include <cstring>

namespace rtpm::ros2 {
namespace {

// Plain CDR, little-endian; then two bytes of options, which are zero.
constexpr std::array kEncapsulation{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
/// Writers pad a message to a multiple of this.
constexpr std::size_t kPaddedTo = 4;

std::size_t padding(std::size_t offset, std::size_t alignment) {
  return (alignment - offset % alignment) % alignment;
}

}  // namespace

CdrWriter::CdrWriter(std::vector<std::byte>& buffer) : buffer_(buffer) {
  buffer_.assign(kEncapsulation.begin(), kEncapsulation.end());
}

std::byte* CdrWriter::grow(std::size_t alignment, std::size_t size) {
  const std::size_t offset = buffer_.size() - kEncapsulation.size();
  buffer_.resize(buffer_.size() + padding(offset, alignment) + size);
  return buffer_.data() + buffer_.size() - size;
}

void CdrWriter::put_text(std::string_view text) {
  text = text.substr(0, text.find('\0'));
  put(static_cast<std::uint32_t>(text.size() + 1));
  put_bytes(std::as_bytes(std::span(text)));
  put(std::uint8_t{0});
}

void CdrWriter::put_bytes(ConstBytes bytes) {
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
}

CdrReader::CdrReader(ConstBytes message) noexcept {
  // The options tell of padding only.
  if (message.size() < kEncapsulation.size() || message[0] != kEncapsulation[0] ||
      message[1] != kEncapsulation[1]) {
    fail("it is not plain little-endian CDR");
    return;
  }
  body_ = message.subspan(kEncapsulation.size());
}

ConstBytes CdrReader::claim(std::size_t alignment, std::size_t size) noexcept {
  const std::size_t skipped = padding(offset_, alignment);
  const std::size_t left = body_.size() - offset_;
  if (!ok()) return {};
  if (skipped > left || size > left - skipped) {
    fail("it is shorter than its type");
    return {};
  }
  const ConstBytes field = body_.subspan(offset_ + skipped, size);
  offset_ += skipped + size;
  return field;
}

std::string_view CdrReader::take_text() noexcept {
  const ConstBytes field = claim(1, take<std::uint32_t>());
  // Some writers give an empty text no NUL.
  if (field.empty()) return {};
  if (field.back() != std::byte{0}) {
    fail("a text has no end");
    return {};
  }
  const std::string_view text(reinterpret_cast<const char*>(field.data()), field.size() - 1);
  return text.substr(0, text.find('\0'));
}

std::size_t CdrReader::take_count(std::size_t size_min) noexcept {
  const std::size_t count = take<std::uint32_t>();
  if (count <= (body_.size() - offset_) / size_min) return count;
  fail("it is shorter than its type");
  return 0;
}

void CdrReader::end() noexcept {
  if (body_.size() - offset_ >= kPaddedTo) fail("it is longer than its type");
}

}  // namespace rtpm::ros2
