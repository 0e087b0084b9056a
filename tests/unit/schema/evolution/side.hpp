#pragma once

#include <chrono>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "rtpm/rpc/generated.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"

/// The common part of the generated programs of the evolution test: servants print the requests and
/// clients the replies that they read, as bytes packed again by their own code.
namespace evolution {

struct Sample {
  std::string path;
  std::shared_ptr<rtpm::rpc::Servant> servant;
  std::function<void(rtpm::rpc::Node&, const std::string& url)> call;
};
extern const std::vector<Sample> kSamples;

inline constexpr auto kPatience = std::chrono::seconds{20};
inline const rtpm::rpc::CallOptions kOptions{.deadline = kPatience};

/// Prints "SAMPLE METHOD WHAT HEX".
/// @threads  any
void record(int sample, int method, const char* what, const std::string& bytes);
void record_error(int sample, int method, std::string_view text);

template <class T>
[[nodiscard]] std::string repack(const T& value) {
  if constexpr (requires { typename T::NativeTableType; }) {
    typename T::NativeTableType object;
    value.UnPackTo(&object);
    flatbuffers::FlatBufferBuilder builder;
    builder.Finish(T::Pack(builder, &object));
    const rtpm::ConstBytes bytes = rtpm::rpc::table_bytes(builder);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  } else {
    return {reinterpret_cast<const char*>(&value), sizeof value};
  }
}

[[nodiscard]] inline rtpm::ConstBytes as_bytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}

template <class T>
[[nodiscard]] T as_struct(std::string_view bytes) {
  T value;
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

/// Replies with the table in `bytes`.
template <class T>
void fill(rtpm::rpc::ReplyBuilder<T>& reply, std::string_view bytes) {
  const std::vector<std::uint64_t> aligned = [&] {
    std::vector<std::uint64_t> words(bytes.size() / 8 + 1);
    std::memcpy(words.data(), bytes.data(), bytes.size());
    return words;
  }();
  typename T::NativeTableType object;
  flatbuffers::GetRoot<T>(aligned.data())->UnPackTo(&object);
  reply.finish(T::Pack(reply.builder(), &object));
}

template <class Client>
[[nodiscard]] std::optional<Client> bind(int sample, rtpm::rpc::Node& node,
                                         const std::string& url) {
  auto client = Client::bind(node, url, {.deadline = kPatience});
  if (!client) {
    record_error(sample, 0, client.error().text());
    return std::nullopt;
  }
  record(sample, 0, "bound", {});
  return std::optional<Client>(std::move(*client));
}

template <class T>
void answered(int sample, int method, const rtpm::expected<T, rtpm::rpc::CallError>& reply) {
  if (!reply) return record_error(sample, method, to_string(reply.error()));
  if constexpr (std::is_void_v<T>) {
    record(sample, method, "reply", {});
  } else if constexpr (requires { **reply; }) {
    record(sample, method, "reply", repack(**reply));
  } else {
    record(sample, method, "reply", repack(*reply));
  }
}

}  // namespace evolution
