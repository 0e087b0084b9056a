// rtpm-registryd: serves the registry of names.
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "rtpm/discovery/announcement.hpp"
#include "rtpm/discovery/scope.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/defaults.hpp"
#include "rtpm/names/servant.hpp"
#include "rtpm/options/options.hpp"
#include "rtpm/options/server_options.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/host.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/wire/url.hpp"
#ifdef RTPM_HAS_SQLITE
#include "rtpm/file_store/file_storage.hpp"
#include "rtpm/file_store/json.hpp"
#endif
#ifdef RTPM_HAS_ETCD
#include "rtpm/etcd_store/etcd_storage.hpp"
#endif

namespace {

constexpr std::string_view kMemory = "memory";

struct Configuration {
  rtpm::options::ServerSettings settings{};
  rtpm::names::Limits limits{};
  std::string store{kMemory};
  bool dumps = false;
  bool loads = false;
  std::string discover{rtpm::names::kThisHost};
};

int fail(const std::string& text) {
  rtpm::rt::print_error("rtpm-registryd", text);
  return 1;
}

void report(std::string_view sentence) {
  rtpm::rt::print_error("rtpm-registryd", sentence);
}

/// The storage of the registry's names; null if they are in memory only.
rtpm::expected<std::unique_ptr<rtpm::names::Storage>, rtpm::SetupError> storage_of(
    const Configuration& configuration) {
  if (configuration.store == kMemory) return nullptr;
  if (configuration.store.starts_with("etcd://")) {
#ifdef RTPM_HAS_ETCD
    return rtpm::etcd_store::make_etcd_storage(configuration.store);
#else
    return rtpm::setup_error("--store " + configuration.store,
                             "this rtpm-registryd is built without etcd",
                             "install the Debian package, or build with -DRTPM_ETCD=ON");
#endif
  }
#ifdef RTPM_HAS_SQLITE
  return rtpm::file_store::make_file_storage(configuration.store);
#else
  return rtpm::setup_error("--store " + configuration.store,
                           "this rtpm-registryd is built without SQLite",
                           "leave --store out, or run the registry on Linux");
#endif
}

#ifdef RTPM_HAS_SQLITE
int dump(rtpm::names::Storage& storage) {
  const auto content = storage.load();
  if (!content) return fail(content.error().text());
  for (const std::string& fault : content->faults)
    report(fault);
  std::fputs(rtpm::file_store::to_json(content->names).c_str(), stdout);
  return 0;
}

int load(rtpm::names::Storage& storage, const Configuration& configuration) {
  const std::string text{std::istreambuf_iterator<char>(std::cin), {}};
  const auto names = rtpm::file_store::parse_json(text, {rtpm::rt::random_u64(), 1});
  if (!names) return fail(names.error().text());
  const auto count = rtpm::names::import_names(storage, *names, configuration.limits);
  if (!count) return fail(count.error().text());
  std::printf("%zu names\n", *count);
  return 0;
}

#else
int dump(rtpm::names::Storage&) {
  return fail("--dump: this rtpm-registryd is built without SQLite");
}
int load(rtpm::names::Storage&, const Configuration&) {
  return fail("--load: this rtpm-registryd is built without SQLite");
}
#endif

/// `--dump` and `--load`: works on the storage only, without serving.
int transfer(const Configuration& configuration) {
  const auto storage = storage_of(configuration);
  if (!storage) return fail(storage.error().text());
  if (*storage == nullptr) return fail("--dump and --load need --store FILE or --store etcd://…");
  if (configuration.dumps && configuration.loads) return fail("give either --dump or --load");
  return configuration.dumps ? dump(**storage) : load(**storage, configuration);
}

/// Announces the registry, or reports why it can't: programs that know its URL need no discovery.
std::unique_ptr<rtpm::discovery::Announcement> announce(const rtpm::rpc::Server& server,
                                                        const rtpm::discovery::Scope& scope) {
  const auto url = rtpm::wire::parse_url(server.url(rtpm::names::kRegistryPath));
  auto announced = rtpm::discovery::Announcement::create(scope, {true, url->hosts, server.port()});
  if (announced) return std::move(*announced);
  report("programs find this registry only by its URL: " + announced.error().text());
  return nullptr;
}

int serve(const Configuration& configuration) {
  const rtpm::program::StopSignal stop;
  const auto scope = rtpm::discovery::parse_scope(configuration.discover);
  if (!scope) return fail(scope.error().text());
  const auto prepared = rtpm::options::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error().text());
  auto storage = storage_of(configuration);
  if (!storage) return fail(storage.error().text());
  auto made = rtpm::names::make_registry(
      {.limits = configuration.limits, .report = report, .storage = std::move(*storage)});
  if (!made) return fail(made.error().text());
  const auto registry = std::move(*made);
  auto server = rtpm::rpc::Server::create(configuration.settings.server);
  if (!server) return fail(server.error().text());
  const rtpm::rpc::ObjectOptions lowest{.model = rtpm::rpc::PriorityModel::kServerDeclared,
                                        .checks_callers = true};
  if (const auto added = (*server)->add(rtpm::names::kRegistryPath, *registry, lowest); !added) {
    return fail(added.error().text());
  }
  rtpm::introspection::Catalog catalog;
  catalog.add(std::string(rtpm::names::kRegistryPath), *registry);
  if (const auto added = catalog.serve(**server); !added) {
    return fail(added.error().text());
  }
  if (const auto started = (*server)->start(); !started) return fail(started.error().text());
  rtpm::options::show_setup(configuration.settings, **server, "rtpm-registryd");
  auto announcement = announce(**server, *scope);
  std::printf("registry at %s\n", (*server)->url(rtpm::names::kRegistryPath).c_str());
  std::fflush(stdout);
  while (!stop.wait_for(std::chrono::seconds{10})) {
    if (announcement) announcement->keep();
  }
  announcement.reset();
  (*server)->stop();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Configuration configuration;
  rtpm::names::Limits& limits = configuration.limits;
  constexpr rtpm::options::Range<std::uint64_t> kCounts{1, 1'000'000};
  std::uint64_t name_count_max = limits.name_count_max;
  std::uint64_t name_count_per_server_max = limits.name_count_per_owner_max;
  std::uint64_t name_count_per_host_max = limits.name_count_per_host_max;
  std::uint64_t server_count_per_host_max = limits.owner_count_per_host_max;
  std::uint64_t name_count_own_host_max = limits.name_count_own_host_max;
  std::uint64_t server_count_own_host_max = limits.owner_count_own_host_max;
  rtpm::options::Options options("rtpm-registryd", "the registry, where servers bind their names");
  rtpm::rpc::ServerConfig& server = configuration.settings.server;
  server.name = "registry";
  server.port = rtpm::names::kDefaultRegistryPort;
  // A single blocking lane, because names are not resolved in real-time loops.
  server.lanes = {{.name = "registry", .wait = {.strategy = rtpm::rt::WaitStrategy::kBlock}}};
  // Each watch is a stream, and changes in etcd wait for etcd.
  server.deferred_call_count_max = static_cast<std::uint32_t>(limits.watch_count_max) + 288;
  server.stream_count_max = static_cast<std::uint32_t>(limits.watch_count_max);
  server.stream_byte_max = 64 * 1024;
  rtpm::options::add_server(options, configuration.settings);
  options.add("store", configuration.store,
              "Where names are kept: memory, the file of a SQLite database, or "
              "etcd://HOST:PORT,HOST:PORT/PREFIX, for several registries together");
  options.add("discover", configuration.discover,
              "Who finds it: host, this one; lan[:DOMAIN]@INTERFACE, the LAN by multicast, too; or "
              "hosts, that ask this one");
  options.add("dump", configuration.dumps, "Print the permanent names of --store as JSON, and end");
  options.add("load", configuration.loads,
              "Bind the names of such JSON on standard input in --store, and end");
  rtpm::options::Options rare = options.rare();
  rare.add("names-max", name_count_max, "Maximum number of names", kCounts);
  rare.add("names-per-server-max", name_count_per_server_max, "Maximum names of one server",
           kCounts);
  rare.add("names-per-host-max", name_count_per_host_max, "Maximum names of one remote host",
           kCounts);
  rare.add("servers-per-host-max", server_count_per_host_max, "Maximum servers of one remote host",
           kCounts);
  rare.add("names-own-host-max", name_count_own_host_max, "Maximum names of this host", kCounts);
  rare.add("servers-own-host-max", server_count_own_host_max, "Maximum servers of this host",
           kCounts);
  if (const auto exit_code = options.parse(argc, argv)) return *exit_code;
  limits.name_count_max = name_count_max;
  limits.name_count_per_owner_max = name_count_per_server_max;
  limits.name_count_per_host_max = name_count_per_host_max;
  limits.owner_count_per_host_max = server_count_per_host_max;
  limits.name_count_own_host_max = name_count_own_host_max;
  limits.owner_count_own_host_max = server_count_own_host_max;
  return configuration.dumps || configuration.loads ? transfer(configuration)
                                                    : serve(configuration);
}
