#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "rtpm/options/options.hpp"
#include "rtpm/rpc/binding.hpp"
#include "rtpm/rpc/node.hpp"

namespace rtpm::tool {

/// Options of `config`.
struct ConfigOptions {
  std::uint64_t revision = 0;          ///< What a change is based on; 0: the present one.
  std::vector<std::string> answers{};  ///< To a calibration's prompts; the last stands for more.
  bool keeps = false;                  ///< A calibration's result, without asking,
  bool discards = false;               ///< or not.
};

/// The input of every verb.
struct Request {
  rpc::Node& node;
  std::string registry{};
  std::vector<std::string> arguments{};  ///< Behind the verb.
  rpc::CallOptions options{};
  std::optional<Duration> stream_time{};  ///< Of a stream or held device; none: until it ends.
  ConfigOptions config{};
};

/// Adds all verbs to the program's options.
void add_verbs(options::Options& options);

/// Whether the added `verb` takes so many arguments.
[[nodiscard]] bool takes(const std::string& verb, std::size_t argument_count);

/// Runs an added verb that takes so many arguments. Prints its result, or one sentence on standard
/// error.
/// @return the exit code: 0 done, 1 failed, 2 a wrong command line
[[nodiscard]] int run(const std::string& verb, const Request& request);

}  // namespace rtpm::tool
