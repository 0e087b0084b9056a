#pragma once

#include <string>

#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/error.hpp"

namespace rtpm::names {

/// Whether the remedy is a matter of keys, so that nothing is wrong with the registry.
[[nodiscard]] inline bool is_about_keys(const SetupError& error) {
  return error.remedy.find("rtpm key ") != std::string::npos;
}

/// Why the registry at `url` was not bound. What a caller can mend, such as keys, keeps its remedy;
/// otherwise the registry is to be started.
[[nodiscard]] inline DirectoryError no_answer(const std::string& url, const SetupError& error) {
  const auto is = [&](rpc::CallError cause) { return error.cause == cause; };
  if (is(rpc::CallError::kNoResources) || is(rpc::CallError::kNotAllowed))
    return {
        {"the registry at " + url + " was not asked", error.reason(), error.remedy, error.cause}};
  const bool is_silence = is(rpc::CallError::kUnreachable) || is(rpc::CallError::kTimeout) ||
                          is(rpc::CallError::kExpired) || is(rpc::CallError::kDisconnected);
  // A known server that shows another key is silent to sealed sessions.
  // Nor does one help whose datagrams a firewall drops, or whose network is down.
  const auto has = [&](const char* word) { return error.remedy.find(word) != std::string::npos; };
  const bool is_kept = is_about_keys(error) || has("firewall") || has("ip link");
  const bool has_remedy = !error.remedy.empty() && (!is_silence || is_kept);
  return {{"no registry answers at " + url, error.reason(),
           has_remedy ? error.remedy : "start rtpm-registryd, or give --registry URL"}};
}

}  // namespace rtpm::names
