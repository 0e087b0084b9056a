#pragma once

#include <string>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema::cpp {

/// The text of <stem>.rtpm.hpp: for each service, the method ids, the client and the servant.
[[nodiscard]] std::string header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.functions.hpp: for each service, a servant made of functions.
[[nodiscard]] std::string functions_header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.events.hpp: for each event of the file, its descriptor, supplier and
/// consumer.
[[nodiscard]] std::string events_header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.cpp: the descriptors and the definitions of the classes.
[[nodiscard]] std::string source(const Model& model, const std::string& compiler_version);

/// The first line of each generated file.
[[nodiscard]] std::string banner(const Model& model, const std::string& compiler_version);

/// The result type of a client's method: "::rtpm::expected<::lab::Pose, ::rtpm::rpc::CallError>".
[[nodiscard]] std::string client_result(const Model& model, const Method& method);
/// The result type of a servant's method: "::rtpm::rpc::Result<::lab::Pose>".
[[nodiscard]] std::string servant_result(const Model& model, const Method& method);
struct Parameter {
  std::string type{};
  std::string name{};
};
[[nodiscard]] std::vector<Parameter> servant_parameters(const Model& model, const Method& method);

/// Whether the method has a begin_…() overload.
[[nodiscard]] bool can_begin(const Method& method) noexcept;
/// The name "begin_get_pose"; then its result type.
[[nodiscard]] std::string begin_name(const Method& method);
[[nodiscard]] std::string begin_result(const Model& model, const Method& method);
/// The type of a pending reply: "::rtpm::rpc::PendingStruct<::lab::Pose>".
/// @param stem  "Pending" or "Deferred"
[[nodiscard]] std::string reply_handle(const Model& model, const Method& method,
                                       const std::string& stem);
/// The type of the caller's end of a stream: "::rtpm::rpc::StructStream<::lab::Pose>".
[[nodiscard]] std::string stream_type(const Model& model, const Method& method);

/// The type of the servant's handle for a deferred reply or a stream:
/// "::rtpm::rpc::DeferredStruct<::lab::Pose>".
[[nodiscard]] std::string deferred_type(const Model& model, const Method& method);
/// The C++ type of a payload.
[[nodiscard]] std::string payload_type(const Model& model, const Payload& payload);

}  // namespace rtpm::schema::cpp
