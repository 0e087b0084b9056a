#pragma once

/// All of rtpm::asio.
// IWYU pragma: begin_exports
#include "rtpm/asio/calls.hpp"
#include "rtpm/asio/events.hpp"
#include "rtpm/asio/names.hpp"
#include "rtpm/asio/queue.hpp"
// IWYU pragma: end_exports
