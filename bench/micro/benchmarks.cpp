// rtpm-micro: times the subjects with Google Benchmark, whose options it takes.
#include <benchmark/benchmark.h>

#include "subjects.hpp"

int main(int argc, char** argv) {
  using namespace rtpm::bench::micro;
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  for (const Subject& subject : subjects()) {
    benchmark::RegisterBenchmark(subject.name, [run = subject.run](benchmark::State& state) {
      run();
      while (state.KeepRunningBatch(kRepeatCount))
        run();
    });
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
