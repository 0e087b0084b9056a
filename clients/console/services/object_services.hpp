#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "live/callbacks.hpp"
#include "live/object_watch.hpp"
#include "operators/operator_desk.hpp"
#include "rtpm/base/time.hpp"
#include "rtpm/dynamic/remote_object.hpp"
#include "rtpm/rpc/node.hpp"
#include "services/call_router.hpp"
#include "work/worker_pool.hpp"

namespace rtpm::console {

/// Serves every method of every registered object as a service, with the schema that its server
/// publishes.
/// @ownership refers to all its arguments
/// @threads  the web server's thread
class ObjectServices {
 public:
  /// @param pool        runs calls
  /// @param background  opens objects
  ObjectServices(rpc::Node& node, CallRouter& router, OperatorDesk& desk, WorkerPool& pool,
                 WorkerPool& background, Post post,
                 std::function<std::shared_ptr<DeviceLink>(const std::string&)> links);

  /// Opens new objects and removes those that are gone.
  void set_objects(const std::vector<ObjectView>& objects);

 private:
  /// An object that answers; only one thread at a time may use its conversions.
  struct Opened {
    std::unique_ptr<dynamic::RemoteObject> remote{};
    std::mutex mutex{};
    std::vector<foxglove::ServiceInfo> services{};
    std::vector<const schema::Method*> methods{};  ///< The method for each service.
  };
  struct Entry {
    ObjectView view{};
    std::shared_ptr<Opened> opened{};
    bool is_opening = false;
    MonotonicTime next{};
  };
  void open(Entry& entry);
  void add(const std::string& name, const std::shared_ptr<Opened>& opened);
  void remove(const Entry& entry);
  void call(const ObjectView& view, const std::shared_ptr<Opened>& opened,
            const schema::Method& method, const PendingCall& call, std::string payload);

  rpc::Node& node_;
  CallRouter& router_;
  OperatorDesk& desk_;
  WorkerPool& pool_;
  WorkerPool& background_;
  Post post_;
  std::function<std::shared_ptr<DeviceLink>(const std::string&)> links_;
  std::map<std::string, Entry> entries_{};
};

}  // namespace rtpm::console
