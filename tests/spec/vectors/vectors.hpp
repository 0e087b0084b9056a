#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "rtpm/base/bytes.hpp"
#include "rtpm/wire/counters.hpp"
#include "rtpm/wire/header.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "rtpm/wire/status.hpp"

/// The helpers with which the tests read spec/vectors/. A vector that can't be read fails its test
/// by an exception that names the place.
namespace rtpm::spec {

using Json = nlohmann::json;
using Bytes = std::vector<std::byte>;

/// The file spec/vectors/<name>, such as "hello.json".
[[nodiscard]] Json read_vectors(const std::string& name);
/// The names of all conversations, such as "lost-call".
[[nodiscard]] std::vector<std::string> conversation_names();

/// The bytes of "48500105…". The block is exactly as long as the bytes, so that a sanitizer detects
/// a read past their end.
[[nodiscard]] Bytes bytes_of_hex(const std::string& hex);
[[nodiscard]] std::string hex_of(ConstBytes bytes);
/// A number, written as "0x…" because JSON readers would round it.
[[nodiscard]] std::uint64_t wide_number(const Json& text);

[[nodiscard]] wire::FrameKind kind_named(const std::string& name);
[[nodiscard]] wire::Status status_named(const std::string& name);
[[nodiscard]] wire::DropReason reason_named(const std::string& name);
[[nodiscard]] wire::Medium medium_named(const std::string& name);

/// The single reason that `after` counts once more than `before`; "" if nothing was dropped, and a
/// list if there are several reasons.
[[nodiscard]] std::string newly_dropped(const wire::FrameCounters& before,
                                        const wire::FrameCounters& after);

}  // namespace rtpm::spec
