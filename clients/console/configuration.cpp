#include "configuration.hpp"

#include <string>

#include "rtpm/incidents/file.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/options/options.hpp"
#include "web/token.hpp"

namespace rtpm::console {

bool is_loopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1";
}

std::optional<int> read_configuration(int argc, const char* const* argv,
                                      Configuration& configuration) {
  configuration.registry = names::kThisHost;
  options::Options options("rtpm-console",
                           "serves a page that shows and operates the system in browsers");
  options.add("port", configuration.port, "The TCP port; 0: any");
  options.add("address", configuration.address, "The address where it listens");
  options.add("insecure-lan", configuration.is_insecure_lan,
              "Allow an --address that other hosts reach; nothing is encrypted");
  options.add_registry(configuration.registry);
  options::add_caller(options, configuration.security);
  options.add("events", configuration.events, "The hub of events, by name or URL");
  options.add("page", configuration.page, "The folder of the page; default: the installed one");
  options.add("recordings", configuration.recordings, "The folder of recordings");
  options.add("incidents", configuration.incidents,
              "The file that keeps the incidents; empty: ~/.local/state/rtpm/incidents.jsonl; "
              "'none': they end with this program");
  options.add("read-only", configuration.is_read_only, "Let nobody command anything");
  options.add_secret(
      "token", configuration.token,
      "What a URL must have to command, else in a --token-file; default: a random one");
  options.add("token-file", configuration.token_file,
              "The file that keeps the token; made with a random one if it is not there");
  options.add("print-token", configuration.prints_token,
              "Print the URL with its token also where standard output is no terminal");
  options::Options rare = options.rare();
  rare.add("host-name", configuration.host_names,
           "Names, besides addresses and localhost, by which browsers may reach it");
  rare.add("seconds", configuration.seconds, "How long to serve; 0: until Ctrl-C", {0, 1e6});
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  if (!is_loopback(configuration.address) && !configuration.is_insecure_lan) {
    return options.usage_error(
        "--address " + configuration.address +
        " is reached by other hosts, and neither the page nor its token is encrypted; use an SSH "
        "tunnel to 127.0.0.1, or give --insecure-lan if you trust all of the network");
  }
  if (!configuration.token.empty() && !configuration.token_file.empty()) {
    return options.usage_error("there are both a token and a --token-file; leave one out");
  }
  if (configuration.incidents.empty()) {
    configuration.incidents = incidents::default_file();
  } else if (configuration.incidents == "none") {
    configuration.incidents.clear();
  }
  if (!configuration.token.empty() && !is_token(configuration.token)) {
    return options.usage_error("the token in RTPM_CONSOLE_TOKEN, or in --config, must have " +
                               std::string(kTokenForm));
  }
  return std::nullopt;
}

}  // namespace rtpm::console
