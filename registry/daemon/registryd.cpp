// rtpm-registryd: serves the registry of names.
#include <cstdint>
#include <cstdio>
#include <string>

#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/program/options.hpp"
#include "rtpm/program/server_options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/server.hpp"

namespace {

struct Configuration {
  rtpm::program::ServerSettings settings{};
  rtpm::names::Limits limits{};
};

int fail(const std::string& text) {
  std::fprintf(stderr, "rtpm-registryd: %s\n", text.c_str());
  return 1;
}

int serve(const Configuration& configuration) {
  const rtpm::program::StopSignal stop;
  const auto registry = rtpm::names::make_servant(configuration.limits);
  const auto prepared = rtpm::program::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error().text);
  auto server = rtpm::rpc::Server::create(configuration.settings.server);
  if (!server) return fail(server.error().text);
  const rtpm::rpc::ObjectOptions lowest{.model = rtpm::rpc::PriorityModel::kServerDeclared};
  if (const auto added = (*server)->add(rtpm::names::kRegistryPath, *registry, lowest); !added) {
    return fail(added.error().text);
  }
  rtpm::introspection::Catalog catalog;
  catalog.add(std::string(rtpm::names::kRegistryPath), *registry);
  if (const auto added = (*server)->add(rtpm::introspection::kPath, catalog); !added) {
    return fail(added.error().text);
  }
  if (const auto started = (*server)->start(); !started) return fail(started.error().text);
  rtpm::program::show_setup(configuration.settings);
  std::printf("registry at %s\n", (*server)->url(rtpm::names::kRegistryPath).c_str());
  std::fflush(stdout);
  stop.wait();
  (*server)->stop();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Configuration configuration;
  std::uint64_t name_count_max = configuration.limits.name_count_max;
  std::uint64_t name_count_per_server_max = configuration.limits.name_count_per_owner_max;
  rtpm::program::Options options("rtpm-registryd", "the registry, where servers bind their names");
  rtpm::rpc::ServerConfig& server = configuration.settings.server;
  server.name = "registry";
  server.port = rtpm::names::kDefaultRegistryPort;
  // One lane that blocks: nobody asks for names in a real-time loop, so a core is worth more.
  server.lanes = {{.name = "registry", .wait = {.strategy = rtpm::rt::WaitStrategy::kBlock}}};
  rtpm::program::add_server(options, configuration.settings);
  options.add("names-max", name_count_max, "How many names it holds", {1, 1'000'000});
  options.add("names-per-server-max", name_count_per_server_max,
              "How many of them one server may bind", {1, 1'000'000});
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  configuration.limits.name_count_max = name_count_max;
  configuration.limits.name_count_per_owner_max = name_count_per_server_max;
  return serve(configuration);
}
