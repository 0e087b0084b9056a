#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "rtpm/base/assert.hpp"
#include "rtpm/base/expected.hpp"
#include "rtpm/ros2/cdr.hpp"
#include "rtpm/ros2/messages.hpp"
#include "rtpm/ros2/type_description.hpp"

/// Encodes, decodes and describes the messages of messages.hpp.
namespace rtpm::ros2 {

template <class T>
concept Message = requires {
  T::kType;
};

namespace detail {

template <class T>
inline constexpr bool kIsVector = false;
template <class T>
inline constexpr bool kIsVector<std::vector<T>> = true;
template <class T>
inline constexpr bool kIsArray = false;
template <class T, std::size_t n>
inline constexpr bool kIsArray<std::array<T, n>> = true;
template <class T>
inline constexpr bool kIsBoundedText = false;
template <std::size_t n>
inline constexpr bool kIsBoundedText<BoundedText<n>> = true;

template <class T>
void put(CdrWriter& to, const T& value) {
  if constexpr (Message<T>) {
    T::fields(value, [&to](std::string_view, const auto& field) { put(to, field); });
  } else if constexpr (std::is_same_v<T, std::string>) {
    to.put_text(value);
  } else if constexpr (kIsBoundedText<T>) {
    RTPM_ASSERT(value.text.size() <= T::kSizeMax, "a bounded text is too long");
    to.put_text(value.text);
  } else if constexpr (Number<T>) {
    to.put(value);
  } else {
    if constexpr (kIsVector<T>) to.put(static_cast<std::uint32_t>(value.size()));
    if constexpr (std::is_same_v<typename T::value_type, std::uint8_t>) {
      to.put_bytes(std::as_bytes(std::span(value)));
    } else {
      for (const auto& element : value)
        put(to, element);
    }
  }
}

template <class T>
void take(CdrReader& from, T& value) {
  if constexpr (Message<T>) {
    T::fields(value, [&from](std::string_view, auto& field) { take(from, field); });
  } else if constexpr (std::is_same_v<T, std::string>) {
    value = from.take_text();
  } else if constexpr (kIsBoundedText<T>) {
    value.text = from.take_text();
    if (value.text.size() > T::kSizeMax) from.fail("a bounded text is too long");
  } else if constexpr (Number<T>) {
    value = from.take<T>();
  } else {
    std::size_t count = value.size();
    if constexpr (kIsVector<T>) {
      using Element = typename T::value_type;
      // A message or a text has at least the four bytes of a length, or a number.
      count = from.take_count(Number<Element> ? sizeof(Element) : 4);
      value.clear();
    }
    // A vector grows with what is there, not by the count that a peer states.
    for (std::size_t i = 0; i < count && from.ok(); ++i) {
      if constexpr (kIsVector<T>) value.emplace_back();
      take(from, value[i]);
    }
  }
}

template <class T>
FieldType field_type(std::vector<TypeDescription>& all);

/// Adds the description of M, unless it is there, and those of the messages that it contains.
template <Message M>
void describe(std::vector<TypeDescription>& all) {
  if (std::ranges::count(all, M::kType, &TypeDescription::name) > 0) return;
  const std::size_t at = all.size();
  all.push_back({M::kType, {}});
  M message;
  M::fields(message, [&]<class T>(std::string_view name, T&) {
    FieldType type = field_type<T>(all);
    all[at].fields.push_back({name, type});
  });
}

template <class T>
FieldType field_type(std::vector<TypeDescription>& all) {
  if constexpr (Message<T>) {
    describe<T>(all);
    return {.type_id = kNestedType, .nested = T::kType};
  } else if constexpr (kIsVector<T> || kIsArray<T>) {
    FieldType type = field_type<typename T::value_type>(all);
    type.type_id = static_cast<std::uint8_t>(type.type_id + (kIsVector<T> ? kSequence : kArray));
    if constexpr (kIsArray<T>) type.capacity = std::tuple_size_v<T>;
    return type;
  } else if constexpr (kIsBoundedText<T>) {
    return {.type_id = kBoundedTextType, .text_capacity = T::kSizeMax};
  } else if constexpr (std::is_same_v<T, std::string>) {
    return {.type_id = kTextType};
  } else {
    return {.type_id = kNumberType<T>};
  }
}

}  // namespace detail

/// Replaces the content of `buffer` by the message.
/// @realtime allocates in `buffer`
template <Message M>
void encode(const M& message, std::vector<std::byte>& buffer) {
  CdrWriter writer(buffer);
  detail::put(writer, message);
}

/// Reads a message of any sender. Takes memory for at most eight times its bytes.
/// @errors   why it is refused, as a clause: "it is shorter than its type"
/// @realtime never
template <Message M>
[[nodiscard]] expected<M, std::string_view> decode(ConstBytes bytes) {
  CdrReader reader(bytes);
  M message;
  detail::take(reader, message);
  if (reader.ok()) reader.end();
  if (!reader.ok()) return unexpected{reader.reason()};
  return message;
}

/// The description of M, then of the messages that it contains, by name.
template <Message M>
[[nodiscard]] std::vector<TypeDescription> describe() {
  std::vector<TypeDescription> all;
  detail::describe<M>(all);
  std::ranges::sort(all.begin() + 1, all.end(), {}, &TypeDescription::name);
  return all;
}

/// The text of M in the encoding `ros2msg`, with those of the messages that it contains.
template <Message M>
[[nodiscard]] std::string definition() {
  return definition_of(describe<M>());
}

/// "RIHS01_…", by which ROS 2 Iron and later tell types apart.
template <Message M>
[[nodiscard]] std::string type_hash() {
  return type_hash_of(describe<M>());
}

}  // namespace rtpm::ros2
