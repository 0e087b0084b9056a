#pragma once

#include "rtpm/transport/wait_set.hpp"

// The sources of a lane's calls, as it and its wait set name them.
namespace rtpm::rpc {

using transport::SourceKind;
using transport::SourceTag;

/// A connection's descriptor; the tag has its slot's index and generation.
inline constexpr SourceKind kConnectionKind{1};
/// The eventfd that the peer of a connection through memory signals; likewise.
inline constexpr SourceKind kEventKind{2};
/// A UDP port of the lane; the tag has its index.
inline constexpr SourceKind kPortKind{3};
/// The first one, mostly the only one.
inline constexpr SourceTag kPortSource{kPortKind};
/// Calls of the same program.
inline constexpr SourceTag kGateSource{SourceKind{4}};

}  // namespace rtpm::rpc
