#pragma once

#include <optional>
#include <string>
#include <vector>

#include "rtpm/options/options.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::tool {

/// What every verb is given.
struct Request {
  rpc::Node& node;
  std::string registry{};
  std::vector<std::string> arguments{};  ///< Behind the verb.
  rpc::CallOptions options{};
  std::optional<Duration> stream_time{};  ///< Of a stream or a held device; none: until it ends.
};

/// Adds all verbs to the program's options.
void add_verbs(options::Options& options);

/// Whether `verb`, which is one of those, takes so many arguments.
[[nodiscard]] bool takes(const std::string& verb, std::size_t argument_count);

/// Runs `verb`, which is one of those and takes so many arguments: prints what it found, or one
/// sentence on standard error. The program's exit code: 0 done, 1 it failed, 2 a wrong command
/// line.
[[nodiscard]] int run(const std::string& verb, const Request& request);

}  // namespace rtpm::tool
