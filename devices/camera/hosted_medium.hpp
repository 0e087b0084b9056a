#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "configuration.hpp"
#include "parameters.hpp"
#include "pipeline.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/configuration/manager.hpp"
#include "rtpm/introspection/catalog.hpp"
#include "rtpm/media/medium_server.hpp"
#include "rtpm/names/registration.hpp"
#include "rtpm/rpc/node.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/rt/log.hpp"
#include "rtpm/rt/semaphore.hpp"
#include "rtpm/rt/thread.hpp"

namespace rtpm::camerad {

/// One medium of this program: its pipeline, which is started again when it fails or ends, its
/// objects and its name.
/// @ownership refers to the configuration and the node, which must outlive it
/// @threads  set-up: one thread
/// @realtime set-up only
class HostedMedium {
 public:
  /// How long a pipeline may give nothing before it counts as failed.
  static constexpr Duration kSilenceMax = std::chrono::seconds{5};

  /// @errors   those of Pipeline::create() and gvd::ConfigurationManager::create()
  [[nodiscard]] static expected<std::unique_ptr<HostedMedium>, SetupError> create(
      const Configuration& configuration, const MediumSettings& settings, rpc::Node& node);
  ~HostedMedium() { stop(); }

  /// Adds the medium's objects to `server`.
  /// @errors   those of rpc::Server::add()
  [[nodiscard]] expected<void, SetupError> add_to(rpc::Server& server,
                                                  introspection::Catalog& catalog);
  /// Starts the pipeline, on the medium's own thread.
  [[nodiscard]] expected<void, SetupError> start();
  /// Binds the name at the registry if one is configured.
  /// @errors   those of names::Registration::create()
  [[nodiscard]] expected<void, SetupError> bind(rpc::Server& server);
  /// Removes the name so that no client finds a server that is about to stop.
  void unbind() noexcept { registration_.reset(); }
  /// Stops the pipeline.
  void stop() noexcept;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }

 private:
  HostedMedium(const Configuration& configuration, const MediumSettings& settings, rpc::Node& node);
  [[nodiscard]] expected<std::unique_ptr<Pipeline>, SetupError> make_pipeline();
  void run();
  [[nodiscard]] std::optional<SetupError> run_pipeline();
  [[nodiscard]] std::optional<SetupError> watch();

  const Configuration& configuration_;
  const MediumSettings& settings_;
  rpc::Node& node_;
  std::string name_;
  media::MediumServer server_;
  std::unique_ptr<Pipeline> pipeline_{};  ///< After start() the thread's.
  bool is_camera_ = false;                ///< Has pictures.
  std::unique_ptr<Parameters> parameters_{};
  std::unique_ptr<gvd::ConfigurationManager> manager_{};
  std::unique_ptr<names::Registration> registration_{};
  rt::Log log_{"rtpm-camerad"};
  std::atomic<bool> is_ending_{false};
  rt::Semaphore ending_{};
  rt::Thread thread_{};
};

}  // namespace rtpm::camerad
