#pragma once

#include "rtpm/transport/wait_set.hpp"

// The sources of a lane's calls, as the lane and its wait set name them.
namespace rtpm::rpc {

using transport::SourceKind;
using transport::SourceTag;

/// A connection's descriptor; the tag has its slot's index and generation.
inline constexpr SourceKind kConnectionKind{1};
/// The eventfd that the peer of a shared-memory connection signals; tagged like kConnectionKind.
inline constexpr SourceKind kEventKind{2};
/// A UDP port of the lane; the tag has its index.
inline constexpr SourceKind kPortKind{3};
/// The first UDP port, usually the only one.
inline constexpr SourceTag kPortSource{kPortKind};
/// Calls within this program.
inline constexpr SourceTag kGateSource{SourceKind{4}};

}  // namespace rtpm::rpc
