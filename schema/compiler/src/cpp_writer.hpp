#pragma once

#include <string>

#include "rtpm/schema/model.hpp"

namespace rtpm::schema::cpp {

/// The text of <stem>.rtpm.hpp: for each service the method numbers, the client and the servant.
[[nodiscard]] std::string header(const Model& model, const std::string& compiler_version);
/// The text of <stem>.rtpm.cpp: the descriptors and what the classes do.
[[nodiscard]] std::string source(const Model& model, const std::string& compiler_version);

/// The first line of each generated file.
[[nodiscard]] std::string banner(const Model& model, const std::string& compiler_version);

/// What a client's method returns: "::rtpm::expected<::lab::Pose, ::rtpm::rpc::CallError>".
[[nodiscard]] std::string client_result(const Model& model, const Method& method);
/// What a servant's method returns: "::rtpm::rpc::Result<::lab::Pose>".
[[nodiscard]] std::string servant_result(const Model& model, const Method& method);
/// What a method that answers later, or with a stream, is given to do so:
/// "::rtpm::rpc::LateStruct<::lab::Pose>".
[[nodiscard]] std::string late_type(const Model& model, const Method& method);
/// The C++ type that a payload is handled as.
[[nodiscard]] std::string payload_type(const Model& model, const Payload& payload);

}  // namespace rtpm::schema::cpp
