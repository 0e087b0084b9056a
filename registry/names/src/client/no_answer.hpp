#pragma once

#include <string>

#include "rtpm/names/directory.hpp"
#include "rtpm/rpc/error.hpp"

namespace rtpm::names {

/// Whether the remedy concerns keys, so that the registry itself is fine.
[[nodiscard]] inline bool is_about_keys(const SetupError& error) {
  return error.remedy.find("rtpm key ") != std::string::npos;
}

/// Why the client could not bind to the registry at `url`. If the caller can fix the cause, such as
/// keys, keeps that remedy; otherwise advises starting the registry.
[[nodiscard]] inline DirectoryError no_answer(const std::string& url, const SetupError& error) {
  const auto is = [&](rpc::CallError cause) { return error.cause == cause; };
  if (is(rpc::CallError::kNoResources) || is(rpc::CallError::kNotAllowed))
    return {
        {"the registry at " + url + " was not asked", error.reason(), error.remedy, error.cause}};
  const bool is_silence = is(rpc::CallError::kUnreachable) || is(rpc::CallError::kTimeout) ||
                          is(rpc::CallError::kExpired) || is(rpc::CallError::kDisconnected);
  // A known server with another key does not answer sealed sessions. Starting a registry would not
  // help if a firewall drops datagrams or the network is down, either.
  const auto has = [&](const char* word) { return error.remedy.find(word) != std::string::npos; };
  const bool is_kept = is_about_keys(error) || has("firewall") || has("ip link");
  const bool has_remedy = !error.remedy.empty() && (!is_silence || is_kept);
  return {{"no registry answers at " + url, error.reason(),
           has_remedy ? error.remedy : "start rtpm-registryd, or give --registry URL"}};
}

}  // namespace rtpm::names
