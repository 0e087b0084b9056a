#pragma once

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "channels/channel_table.hpp"
#include "channels/event_channels.hpp"
#include "channels/media_channels.hpp"
#include "configuration.hpp"
#include "downloads/download_desk.hpp"
#include "history/history_desk.hpp"
#include "incidents/incident_desk.hpp"
#include "live/device_state.hpp"
#include "live/device_watch.hpp"
#include "live/hub_report.hpp"
#include "live/hub_watch.hpp"
#include "live/lane_watch.hpp"
#include "live/media_watch.hpp"
#include "live/object_watch.hpp"
#include "marks/mark_desk.hpp"
#include "operators/operator_desk.hpp"
#include "operators/stop_desk.hpp"
#include "parameters/parameter_desk.hpp"
#include "recording/record_desk.hpp"
#include "review/review_desk.hpp"
#include "rtpm/base/setup_error.hpp"
#include "rtpm/rpc/node.hpp"
#include "services/call_router.hpp"
#include "services/object_services.hpp"
#include "sessions/clients.hpp"
#include "web/connection.hpp"
#include "web/gateway.hpp"
#include "work/periodic_thread.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// The page's server side: answers clients, and watches the system for them.
/// @ownership refers to its node
/// @threads  the web server's thread, except for start() and stop()
class Console final : public ConnectionHandler, public DownloadSource, public GatewayTargets {
 public:
  Console(rpc::Node& node, const Configuration& configuration, Post post);
  ~Console() override;

  /// Starts the threads that watch the system.
  /// @param every  runs work periodically on the web server's thread
  [[nodiscard]] expected<void, SetupError> start(
      const std::function<void(Duration, std::function<void()>)>& every);
  /// Ends the threads after the web server's thread has ended; releases leases.
  void stop();

  void on_open(Connection& connection) override;
  void on_text(Connection& connection, std::string_view text) override;
  void on_binary(Connection& connection, ConstBytes bytes) override;
  void on_close(Connection& connection, MonotonicTime since) override;
  [[nodiscard]] std::optional<Download> take_download(std::string_view ticket) override;
  [[nodiscard]] std::vector<ServerAddress> gateway_addresses(std::string_view to) const override;

 private:
  [[nodiscard]] expected<void, SetupError> start_threads();
  void take_text(std::uint64_t id, foxglove::TextRequest request);
  void take_garbage(std::uint64_t id, const std::string& why);
  void take_objects(const ObjectsView& view);
  void take_lost(const ObjectsView& view);
  void dismiss(const PendingCall& call, const nlohmann::json& request);
  void take_event(const HubEvent& event);
  void take_probe(const DeviceProbe& probe);
  void add_log_filter();
  void set_log(const PendingCall& call, const nlohmann::json& request);
  void publish_state();
  void publish_latency();
  void publish_graph();
  [[nodiscard]] nlohmann::ordered_json state() const;

  rpc::Node& node_;
  const Configuration configuration_;
  Post post_;
  MonotonicTime begin_;
  std::string session_id_;
  Clients clients_{};
  ChannelTable channels_;
  EventChannels event_channels_;
  MediaChannels media_channels_;
  CallRouter router_;
  WorkerPool pool_{};        ///< Work for clients that may command.
  WorkerPool background_{};  ///< Work for the console itself and for observers.
  WorkerPool urgent_{};      ///< Emergency stops.
  StopDesk stops_;
  OperatorDesk desk_;
  IncidentDesk incidents_;
  ObjectServices objects_services_;
  HistoryDesk history_;
  ParameterDesk parameters_;
  RecordDesk records_;
  DownloadDesk downloads_;
  MarkDesk marks_;
  ReviewDesk reviews_;
  HubWatch hub_;
  DeviceWatch device_watch_;
  MediaWatch media_watch_;
  std::map<std::string, DeviceState> devices_{};  ///< Bound and lost devices.
  std::set<std::string> device_names_{};          ///< Bound devices.
  /// Lapsed names that were dismissed: registry, name and revision.
  std::set<std::tuple<std::string, std::string, std::uint64_t>> dismissed_{};
  ObjectsView objects_{};
  Standing hub_standing_{};
  HubReportView hub_view_{};
  std::vector<ServerView> servers_{};
  foxglove::Graph graph_{};
  PeriodicThread lane_thread_{};
  PeriodicThread object_thread_{};
  PeriodicThread probe_thread_{};
  PeriodicThread hub_thread_{};
  PeriodicThread report_thread_{};
  PeriodicThread stop_thread_{};
  PeriodicThread media_thread_{};
};

}  // namespace rtpm::console
