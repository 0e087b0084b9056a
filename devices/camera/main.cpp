// rtpm-camerad: serves cameras and microphones. It runs a GStreamer pipeline for each, and gives its
// pictures and sound to readers as streams.
#include <cstdio>
#include <memory>
#include <utility>
#include <vector>

#include "configuration.hpp"
#include "hosted_medium.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/names/resolver.hpp"
#include "rtpm/program/stop_signal.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"

namespace rtpm::camerad {
namespace {

using Media = std::vector<std::unique_ptr<HostedMedium>>;

int fail(const SetupError& error) {
  rt::print_error("rtpm-camerad", error.text());
  return 1;
}

/// A medium that can't be created is logged and skipped: it must not affect the others.
Media create_media(const Configuration& configuration, rpc::Node& node) {
  Media media;
  for (const MediumSettings& settings : configuration.media) {
    auto medium = HostedMedium::create(configuration, settings, node);
    if (medium) {
      media.push_back(std::move(*medium));
    } else {
      fail(medium.error());
    }
  }
  return media;
}

expected<void, SetupError> start(const Media& media, rpc::Server& server,
                                 introspection::Catalog& catalog) {
  for (const auto& medium : media) {
    if (auto added = medium->add_to(server, catalog); !added) return added;
  }
  if (auto added = catalog.serve(server); !added) return added;
  if (auto started = server.start(); !started) return started;
  for (const auto& medium : media) {
    if (auto started = medium->start(); !started) return started;
    if (auto bound = medium->bind(server); !bound) return bound;
  }
  return {};
}

int serve(const Configuration& configuration) {
  const program::StopSignal stop;
  const auto prepared = options::prepare(configuration.settings);
  if (!prepared) return fail(prepared.error());
  gst_init(nullptr, nullptr);
  rpc::Node node({.wait = {.strategy = rt::WaitStrategy::kBlock},
                  .security = options::node_security(configuration.settings),
                  .served = configuration.settings.server.security});
  names::RegistryResolver resolver(node, configuration.registry);
  if (configuration.registry != kNoRegistry) node.use(resolver);
  const Media media = create_media(configuration, node);
  if (media.empty()) return 1;
  rpc::ServerConfig server_config = configuration.settings.server;
  server_config.name = "rtpm-camerad";
  auto server = rpc::Server::create(std::move(server_config));
  if (!server) return fail(server.error());
  introspection::Catalog catalog;
  if (auto started = start(media, **server, catalog); !started) return fail(started.error());
  options::show_setup(configuration.settings, **server, "rtpm-camerad");
  for (const auto& medium : media) {
    std::printf("serving %s at %s\n", medium->name().c_str(),
                (*server)->url(medium->name()).c_str());
  }
  std::fflush(stdout);

  stop.wait();
  // First removes the names, so that no client finds a server that is about to stop.
  for (const auto& medium : media)
    medium->unbind();
  for (const auto& medium : media)
    medium->stop();
  (*server)->stop();
  return media.size() == configuration.media.size() ? 0 : 1;
}

}  // namespace
}  // namespace rtpm::camerad

int main(int argc, char** argv) {
  rtpm::camerad::Configuration configuration;
  if (const auto exit_code = rtpm::camerad::read_configuration(argc, argv, configuration)) {
    return *exit_code;
  }
  return rtpm::camerad::serve(configuration);
}
