#include "configuration.hpp"

#include <algorithm>
#include <cctype>

#include "rtpm/names/defaults.hpp"
#include "rtpm/options/caller_options.hpp"
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
  options.add("read-only", configuration.is_read_only, "Let nobody command anything");
  options.add("token", configuration.token,
              "What a URL must have to command; default: a random one");
  options.add("seconds", configuration.seconds, "How long to serve; 0: until Ctrl-C", {0, 1e6});
  if (const auto exit_code = options.parse(argc, argv)) return exit_code;
  if (!is_loopback(configuration.address) && !configuration.is_insecure_lan) {
    return options.usage_error(
        "--address " + configuration.address +
        " is reached by other hosts, and neither the page nor its token is encrypted; use an SSH "
        "tunnel to 127.0.0.1, or give --insecure-lan if you trust all of the network");
  }
  const bool fits_url = std::ranges::all_of(configuration.token, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.' || c == '~';
  });
  if (!configuration.token.empty() && (!fits_url || configuration.token.size() < kTokenSizeMin)) {
    return options.usage_error("--token takes at least " + std::to_string(kTokenSizeMin) +
                               " of A-Z a-z 0-9 - _ . ~");
  }
  return std::nullopt;
}

}  // namespace rtpm::console
