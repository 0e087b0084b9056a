#pragma once

#include "rtpm/driver/sample.hpp"

namespace rtpm::gvd {

/// Receives samples. Displays and loggers implement it, as in the paper's Figure 5.
/// @threads  one call at a time, on the poller's or consumer's thread
class SampleSink {
 public:
  SampleSink() = default;
  SampleSink(const SampleSink&) = delete;
  SampleSink& operator=(const SampleSink&) = delete;
  virtual ~SampleSink() = default;
  /// Receives one sample. May block or allocate: this delays only its own samples.
  virtual void push(const driver::Sample& sample) = 0;
};

}  // namespace rtpm::gvd
