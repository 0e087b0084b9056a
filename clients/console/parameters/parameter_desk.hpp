#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "foxglove/requests.hpp"
#include "live/callbacks.hpp"
#include "parameters/parameter_values.hpp"
#include "rtpm/configuration/client.hpp"
#include "rtpm/rpc/node.hpp"
#include "sessions/clients.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// A parameter that is a number; 1 is true.
struct NumericParameter {
  std::string name{};
  std::string unit{};
  double value = 0;
};

/// Presents the parameters of all objects with a configuration as the protocol's parameters.
/// @ownership refers to all its arguments
/// @threads  the web server's thread
class ParameterDesk {
 public:
  /// @param pool        runs the work of clients that may command
  /// @param background  runs all other work
  /// @param on_numbers  gets all numbers of an object each time they are read
  ParameterDesk(
      rpc::Node& node, Clients& clients, WorkerPool& pool, WorkerPool& background, Post post,
      std::function<void(const std::string&, const std::vector<NumericParameter>&)> on_numbers);

  /// Sets the objects that serve a configuration below their name.
  void set_objects(std::vector<std::string> names);
  [[nodiscard]] bool has(const std::string& object) const;

  void get(Client& client, const foxglove::GetParameters& request);
  void set(Client& client, const foxglove::SetParameters& request);
  void watch(Client& client, const foxglove::WatchParameters& request);
  /// Sends the changed parameters of an object to the clients that watch them.
  void on_change(const std::string& object);
  /// Detects changes that no event reported. Call it every few seconds.
  void poll();

 private:
  /// The configuration of an object, bound by the first worker that needs it.
  struct Link {
    std::mutex mutex{};
    std::optional<gvd::ConfigurationClient> client{};  ///< Guarded by `mutex`.
    bool is_asked = false;     ///< A request for changes is in progress. Web server's thread only.
    bool is_outdated = false;  ///< It may have changed since then. Web server's thread only.
  };
  /// The work of one worker with a bound configuration.
  struct Found {
    std::vector<foxglove::ParameterInfo> parameters{};
    std::string problem{};
    std::vector<NumericParameter> numbers{};
  };
  /// The answers of several objects to one request.
  struct Gathering;

  [[nodiscard]] Found list(const std::string& object, Link& link);
  [[nodiscard]] Found apply(const std::string& object, Link& link,
                            const std::vector<foxglove::ParameterRequest>& parameters);
  [[nodiscard]] expected<gvd::DeviceConfiguration, std::string> read(const std::string& object,
                                                                     Link& link);
  void end(const std::shared_ptr<Gathering>& gathering, Found found);
  void publish(const std::vector<foxglove::ParameterInfo>& parameters);

  rpc::Node& node_;
  Clients& clients_;
  WorkerPool& pool_;
  WorkerPool& background_;
  Post post_;
  std::function<void(const std::string&, const std::vector<NumericParameter>&)> on_numbers_;
  std::vector<std::string> names_{};
  std::map<std::string, std::shared_ptr<Link>> links_{};
  std::map<std::string, nlohmann::json> published_{};  ///< The values that watchers have received.
};

}  // namespace rtpm::console
