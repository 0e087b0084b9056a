#pragma once

#include <string_view>

#include "local/local.hpp"
#include "model/object_table.hpp"
#include "model/report.hpp"
#include "rtpm/rpc/server.hpp"
#include "rtpm/wire/server_sessions.hpp"
#include "security/lane_rights.hpp"
#include "tap/lane_tap.hpp"

namespace rtpm::rpc {

class CallDeferral;
class RefusalNotes;

/// The outcome of a method.
struct Ran {
  DispatchResult result{};
  bool has_thrown = false;
};

/// Maps a request to its method, and runs it at the request's priority.
/// @threads  any
/// @realtime alloc-free
class Dispatch {
 public:
  /// @param lane_priority  for methods whose objects have no priority model
  Dispatch(const ObjectTable& objects, PriorityTransform transform, Priority lane_priority,
           const LocalHost& host, LaneTap& tap, LaneRights& rights, RefusalNotes* refusals) noexcept
      : objects_(objects),
        transform_(transform),
        lane_priority_(lane_priority),
        host_(host),
        tap_(tap),
        rights_(rights),
        refusals_(refusals) {}

  /// The object on which a method would run, or why it may not. Every call passes this check before
  /// it runs, over any transport. `sessions` holds the request's session; null for a call within
  /// this program.
  /// @threads  with the lane's Lead; calls within this program: any
  [[nodiscard]] expected<Target, wire::Status> target_of(
      const wire::Request& request, const wire::ServerSessions* sessions) const noexcept;
  [[nodiscard]] Priority priority_of(const Object& object,
                                     const wire::Header& header) const noexcept;
  /// Runs the method at the request's priority, which the thread keeps afterwards, and passes the
  /// call to the tap.
  [[nodiscard]] Ran run(const Target& target, const wire::Request& request, MutableBytes reply,
                        CallDeferral& deferral) const noexcept;
  /// Answers a request to the session service.
  [[nodiscard]] DispatchResult serve_session(const wire::Request& request,
                                             const wire::ServerSessions& sessions,
                                             MutableBytes reply) const noexcept;
  /// Runs a method inside another one on the same thread, then restores the thread's priority.
  [[nodiscard]] DispatchResult run_nested(const LocalChannel& channel,
                                          LaneReport& report) const noexcept;

 private:
  [[nodiscard]] Ran run_method(const Target& target, const wire::Request& request,
                               MutableBytes reply, CallDeferral& deferral) const noexcept;
  [[nodiscard]] Ran fail(const Target& target, const wire::Request& request, MutableBytes reply,
                         const CallDeferral& deferral, std::string_view thrown) const noexcept;

  const ObjectTable& objects_;
  PriorityTransform transform_;
  Priority lane_priority_;
  const LocalHost& host_;
  LaneTap& tap_;
  LaneRights& rights_;
  RefusalNotes* refusals_;
};

/// A request for a call within this program, as if it had arrived over a transport.
[[nodiscard]] wire::Request request_of(const LocalChannel& channel) noexcept;

}  // namespace rtpm::rpc
