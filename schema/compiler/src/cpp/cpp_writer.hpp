#pragma once

#include <string>
#include <vector>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema::cpp {

/// The text of <stem>.rtpm.hpp: for each service the method numbers, the client and the servant.
[[nodiscard]] std::string header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.functions.hpp: for each service a servant made of functions.
[[nodiscard]] std::string functions_header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.events.hpp: for each event of the file what suppliers, consumers and
/// filters need.
[[nodiscard]] std::string events_header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.cpp: the descriptors and what the classes do.
[[nodiscard]] std::string source(const Model& model, const std::string& compiler_version);

/// The first line of each generated file.
[[nodiscard]] std::string banner(const Model& model, const std::string& compiler_version);

/// What a client's method returns: "::rtpm::expected<::lab::Pose, ::rtpm::rpc::CallError>".
[[nodiscard]] std::string client_result(const Model& model, const Method& method);
/// What a servant's method returns: "::rtpm::rpc::Result<::lab::Pose>".
[[nodiscard]] std::string servant_result(const Model& model, const Method& method);
/// A parameter of a function.
struct Parameter {
  std::string type{};
  std::string name{};
};
/// What a servant's method takes.
[[nodiscard]] std::vector<Parameter> servant_parameters(const Model& model, const Method& method);

/// Whether a call of the method can be begun and its reply be waited for later.
[[nodiscard]] bool can_begin(const Method& method) noexcept;
/// "begin_get_pose", and what it returns.
[[nodiscard]] std::string begin_name(const Method& method);
[[nodiscard]] std::string begin_result(const Model& model, const Method& method);
/// The handle of a reply that is not there yet: "::rtpm::rpc::PendingStruct<::lab::Pose>".
[[nodiscard]] std::string reply_handle(const Model& model, const Method& method,
                                       const std::string& stem);
/// What a stream's caller gets: "::rtpm::rpc::StructStream<::lab::Pose>".
[[nodiscard]] std::string stream_type(const Model& model, const Method& method);

/// What a method that answers later, or with a stream, is given to do so:
/// "::rtpm::rpc::DeferredStruct<::lab::Pose>".
[[nodiscard]] std::string deferred_type(const Model& model, const Method& method);
/// The C++ type that a payload is handled as.
[[nodiscard]] std::string payload_type(const Model& model, const Payload& payload);

}  // namespace rtpm::schema::cpp
