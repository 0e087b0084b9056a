// The matrix of languages in C++, see tests/interop/README.md.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "checks.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/test/temporary_folder.hpp"
#include "server.hpp"

namespace rtpm::interop {
namespace {

using Options = std::map<std::string, std::string>;

int fail(const std::string& text) {
  std::fprintf(stderr, "interop: %s\n", text.c_str());
  return 1;
}

rpc::ServerConfig server_config(const Options& options, const test::TemporaryFolder& folder) {
  rpc::ServerConfig config;
  config.realtime = rt::RealtimeMode::kOff;
  config.shared_memory = false;
  if (const auto key = options.find("--key"); key != options.end()) {
    config.security.key_file = key->second;
    config.security.authorized_file = folder.file("authorized");
    std::ofstream(config.security.authorized_file)
        << options.at("--admit") << " role=administer on=**\n";
  }
  return config;
}

int serve(const Options& options) {
  const test::TemporaryFolder folder;
  rpc::Node node;
  const auto registry = options.find("--registry");
  std::optional<names::RegistryResolver> resolver;
  if (registry != options.end()) {
    resolver.emplace(node, registry->second);
    node.use(*resolver);
  }
  Servant servant(node);
  OtherObject other;
  auto server = rpc::Server::create(server_config(options, folder));
  if (!server) return fail(server.error().text());
  introspection::Catalog catalog;
  catalog.add("interop", servant);
  catalog.add("interop/other", other);
  for (const auto& added :
       {(*server)->add("interop", servant), (*server)->add("interop/other", other),
        catalog.serve(**server), (*server)->start()}) {
    if (!added) return fail(added.error().text());
  }
  const std::string url = (*server)->url("interop");
  std::unique_ptr<names::Registration> registration;
  if (const auto name = options.find("--name"); name != options.end()) {
    auto created = names::Registration::create(node, registry->second, name->second, url,
                                               std::string(servant.interface().name));
    if (!created) return fail(created.error().text());
    registration = std::move(*created);
  }
  std::printf("%s\n", nlohmann::json{{"udp", url}, {"tcp", url}}.dump().c_str());
  std::fflush(stdout);
  while (std::cin.get() != std::char_traits<char>::eof()) {
  }
  registration.reset();
  (*server)->stop();
  return 0;
}

int check_url(const std::string& url, const Options& options) {
  const test::TemporaryFolder folder;
  rpc::NodeConfig config;
  config.default_deadline = std::chrono::seconds{5};
  if (const auto key = options.find("--key"); key != options.end()) {
    config.security.key_file = key->second;
    config.security.known_servers_file = folder.file("known_servers");
    std::ofstream(config.security.known_servers_file)
        << "127.0.0.1 " << options.at("--server-key") << "\n";
  }
  const auto value = [&options](const std::string& name) {
    const auto found = options.find(name);
    return found == options.end() ? std::string() : found->second;
  };
  const rpc::Transport transport =
      value("--transport") == "tcp" ? rpc::Transport::kTcp : rpc::Transport::kUdp;
  config.transport = transport;
  rpc::Node node(config);
  std::optional<names::RegistryResolver> resolver;
  if (options.contains("--registry")) {
    resolver.emplace(node, value("--registry"));
    node.use(*resolver);
  }
  return check(node, {.url = url,
                      .transport = transport,
                      .registry = value("--registry"),
                      .name = value("--name"),
                      .device = value("--device"),
                      .is_lossy = options.contains("--lossy")})
             ? 0
             : 1;
}

int run(std::vector<std::string> arguments) {
  if (arguments.empty()) return fail("serve or check is missing");
  const std::string verb = arguments.front();
  Options options;
  std::string url;
  for (std::size_t i = 1; i < arguments.size(); ++i) {
    if (arguments[i] == "--lossy") {
      options[arguments[i]] = "";
    } else if (arguments[i].starts_with("--") && i + 1 < arguments.size()) {
      options[arguments[i]] = arguments[i + 1];
      ++i;
    } else {
      url = arguments[i];
    }
  }
  if (verb == "serve") return serve(options);
  if (verb == "check" && !url.empty()) return check_url(url, options);
  return fail("serve or check URL is missing");
}

}  // namespace
}  // namespace rtpm::interop

int main(int count, char** arguments) {
  return rtpm::interop::run({arguments + 1, arguments + count});
}
