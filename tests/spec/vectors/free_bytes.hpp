#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <string_view>

#include "conversation.hpp"

namespace rtpm::spec {

[[nodiscard]] inline std::string_view name_of(Role role) {
  return role == Role::kClient ? "client" : "server";
}

/// The bytes that one side is free to choose: `<name>` in a vector's hex. The bytes of
/// the tested side are learned from the first frame that contains them; the other side's bytes are
/// the examples.
class FreeBytes {
 public:
  FreeBytes(const Json& free, Role role) {
    for (const auto& [name, choice] : free.items()) {
      size_[name] = choice.at("size");
      if (choice.at("chosen_by") != name_of(role)) known_[name] = choice.at("example");
    }
  }

  /// The hex of a frame that is given to the tested side.
  [[nodiscard]] std::string fill_in(const std::string& pattern) const {
    std::string hex;
    for_each_part(pattern, [&](const std::string& part, bool is_name) {
      if (!is_name) hex += part;
      if (is_name) hex += known(part);
      return true;
    });
    return hex;
  }
  /// Whether a frame of the tested side matches the pattern; learns names when they first occur.
  [[nodiscard]] bool matches(const std::string& pattern, const std::string& hex) {
    std::map<std::string, std::string> learned;
    std::size_t at = 0;
    const bool is_same = for_each_part(pattern, [&](const std::string& part, bool is_name) {
      const std::size_t size = is_name ? 2 * size_.at(part) : part.size();
      if (at + size > hex.size()) return false;
      const std::string here = hex.substr(at, size);
      at += size;
      if (!is_name) return here == part;
      if (known_.contains(part)) return here == known_[part];
      const auto [known, is_first] = learned.try_emplace(part, here);
      return is_first || known->second == here;
    });
    if (!is_same || at != hex.size()) return false;
    for (const auto& [name, value] : learned)
      learn(name, value);
    return true;
  }
  /// A number, written as itself or as "<name>".
  [[nodiscard]] std::uint64_t number(const Json& value) const {
    if (value.is_number()) return value;
    return little_endian(fill_in(value));
  }

 private:
  [[nodiscard]] static std::uint64_t little_endian(const std::string& hex) {
    std::uint64_t value = 0;
    const Bytes bytes = bytes_of_hex(hex);
    for (std::size_t i = bytes.size(); i > 0; --i)
      value = value << 8 | std::to_integer<std::uint64_t>(bytes[i - 1]);
    return value;
  }
  [[nodiscard]] std::string known(const std::string& name) const {
    const auto found = known_.find(name);
    if (found != known_.end()) return found->second;
    ADD_FAILURE() << "<" << name << "> is used before it was sent";
    return std::string(2 * size_.at(name), '0');
  }
  /// A name without its number: choices of one kind are different, and calls count upward.
  [[nodiscard]] static std::string kind_of(const std::string& name) {
    return name.substr(0, name.find_last_not_of("0123456789") + 1);
  }
  void learn(const std::string& name, const std::string& value) {
    const std::string kind = kind_of(name);
    for (const auto& [other, other_value] : known_) {
      if (kind_of(other) != kind || kind == "cookie") continue;
      EXPECT_NE(value, other_value) << "<" << name << "> is the same as <" << other << ">";
      if (kind != "call") continue;
      const auto step =
          static_cast<std::uint32_t>(little_endian(value) - little_endian(other_value));
      EXPECT_LT(step, 1u << 31) << "<" << name << "> is not later than <" << other << ">";
    }
    known_[name] = value;
  }
  /// Calls `take(part, is_name)` for the stretches of a pattern until it returns false.
  template <class Take>
  static bool for_each_part(const std::string& pattern, const Take& take) {
    for (std::size_t at = 0; at < pattern.size();) {
      const bool is_name = pattern[at] == '<';
      const std::size_t end = std::min(pattern.find(is_name ? '>' : '<', at), pattern.size());
      if (!take(pattern.substr(at + (is_name ? 1 : 0), end - at - (is_name ? 1 : 0)), is_name)) {
        return false;
      }
      at = is_name ? end + 1 : end;
    }
    return true;
  }

  std::map<std::string, std::size_t> size_;
  std::map<std::string, std::string> known_;
};

}  // namespace rtpm::spec
