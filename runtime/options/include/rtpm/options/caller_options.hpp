#pragma once

#include "rtpm/options/options.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::options {

/// Adds the options of a program that calls servers, for NodeConfig::security: --key,
/// --known-servers and --key-log.
/// @ownership `security` must not move until Options::parse() has returned
/// @realtime set-up only
void add_caller(Options& options, rpc::NodeSecurity& security);

}  // namespace rtpm::options
