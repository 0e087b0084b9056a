#include "rtpm/rpc/refusal.hpp"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <string_view>

namespace rtpm::rpc {
namespace {

/// A sentence in a fixed buffer, truncated at its end.
class Sentence {
 public:
  Sentence& add(std::string_view text) noexcept {
    const std::size_t count = std::min(text.size(), text_.size() - size_);
    std::memcpy(text_.data() + size_, text.data(), count);
    size_ += count;
    return *this;
  }
  template <class Number>
  Sentence& add_number(Number number) noexcept {
    std::array<char, 32> digits{};
    const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), number);
    return add(error == std::errc{} ? std::string_view(digits.data(), end) : "?");
  }
  [[nodiscard]] std::string_view text() const noexcept { return {text_.data(), size_}; }

 private:
  std::array<char, wire::kRefusalTextSizeMax> text_;
  std::size_t size_ = 0;
};

/// Cuts `text` at `size`, without splitting its last character.
std::string_view whole_characters(std::string_view text, std::size_t size) noexcept {
  if (text.size() <= size) return text;
  while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xc0U) == 0x80U)
    --size;
  return text.substr(0, size);
}

}  // namespace

DispatchResult refuse(wire::Status status, std::string_view text, MutableBytes reply) noexcept {
  const std::string_view whole =
      whole_characters(text, std::min(wire::kRefusalTextSizeMax, reply.size()));
  if (!whole.empty()) std::memcpy(reply.data(), whole.data(), whole.size());
  return {status, static_cast<std::uint32_t>(whole.size())};
}

DispatchResult refuse_request(std::string_view wanted, ConstBytes request,
                              MutableBytes reply) noexcept {
  Sentence sentence;
  sentence.add("the request of ").add_number(request.size()).add(" bytes is not ").add(wanted);
  sentence.add(": the schemas differ");
  return refuse(wire::Status::kBadRequest, sentence.text(), reply);
}

bool RangeCheck::find(double number, std::string_view field, std::string_view limits) noexcept {
  number_ = number;
  limits_ = limits;
  prepend(field);
  return false;
}

bool RangeCheck::within(std::string_view field) noexcept {
  if (path_size_ > 0) prepend(".");
  prepend(field);
  return false;
}

bool RangeCheck::within(std::string_view field, std::uint32_t index) noexcept {
  if (path_size_ > 0) prepend(".");
  prepend(Sentence{}.add(field).add("[").add_number(index).add("]").text());
  return false;
}

// If the path is too long, keeps its outer end.
void RangeCheck::prepend(std::string_view text) noexcept {
  const std::size_t count = std::min(text.size(), path_.size());
  const std::size_t kept = std::min(path_size_, path_.size() - count);
  char* const end = path_.data() + path_.size();
  std::memmove(end - kept, end - path_size_, kept);
  std::memcpy(end - kept - count, text.data(), count);
  path_size_ = kept + count;
}

DispatchResult RangeCheck::refuse(MutableBytes reply) const noexcept {
  Sentence sentence;
  sentence.add({path_.data() + path_.size() - path_size_, path_size_}).add(" is ");
  is_float_ ? sentence.add_number(static_cast<float>(number_)) : sentence.add_number(number_);
  sentence.add(", but must be ").add(limits_);
  return rpc::refuse(wire::Status::kBadRequest, sentence.text(), reply);
}

}  // namespace rtpm::rpc
