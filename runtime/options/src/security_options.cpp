#include "security_options.hpp"

#include "rtpm/options/caller_options.hpp"

namespace rtpm::options {
namespace {

void add_key(Options& options, std::string& file) {
  options.add("key", file,
              "The program's key; empty: ~/.config/rtpm/key, or in the folder of RTPM_KEYS");
}

void add_key_log(Options& options, std::string& file) {
  options.add("key-log", file,
              "Write keys of sessions here, for Wireshark: who has them reads all; empty: nowhere");
}

}  // namespace

void add_known_servers(Options& options, std::string& file) {
  const Options::Shared shared(options);
  options.add("known-servers", file,
              "Servers to call over sealed sessions only, from `rtpm key learn`; empty: "
              "~/.config/rtpm/known_servers");
}

void add_caller(Options& options, rpc::NodeSecurity& security) {
  const Options::Shared shared(options);
  add_key(options, security.key_file);
  add_known_servers(options, security.known_servers_file);
  add_key_log(options, security.key_log_file);
}

void add_server_security(Options& options, rpc::ServerSecurity& security) {
  const Options::Shared shared(options);
  options.add("authorized", security.authorized_file,
              "Who may do what, lines from `rtpm key authorize`; empty: ~/.config/rtpm/authorized "
              "for other addresses than loopback");
  add_key(options, security.key_file);
  options.add("insecure", security.is_insecure,
              "Serve whoever reaches the port: everybody there can move devices");
  options.add("audit", security.audit_file,
              "Write sessions, refusals and administration here; empty: nowhere");
  add_key_log(options, security.key_log_file);
}

}  // namespace rtpm::options
