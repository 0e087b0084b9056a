#pragma once

#include "rtpm/options/options.hpp"
#include "rtpm/rpc/security.hpp"

namespace rtpm::options {

/// Adds the options of a server's security.
void add_server_security(Options& options, rpc::ServerSecurity& security);
/// Adds --known-servers.
void add_known_servers(Options& options, std::string& file);

}  // namespace rtpm::options
