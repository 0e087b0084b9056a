/*
 * A virtual wall in C: below y = 0 it pushes the hand up, 1000 times a second.
 *   wall DEVICE SECONDS          cc wall.c -lrtpm-c -o wall && ./wall lab/arm0 10
 */
#define _POSIX_C_SOURCE 200112L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <rtpm/rtpm.h>

static const double kStiffness = 400; /* newton per metre */
static const long kPeriodNs = 1000000;

static int fail(const char* what) {
  fprintf(stderr, "wall: %s: %s\n", what, rtpm_last_error());
  return 1;
}

static void wait_for_cycle(struct timespec* next) {
  next->tv_nsec += kPeriodNs;
  if (next->tv_nsec >= 1000000000L) {
    next->tv_nsec -= 1000000000L;
    ++next->tv_sec;
  }
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, next, NULL);
}

int main(int argc, char** argv) {
  const char* name = argc > 1 ? argv[1] : "lab/arm0";
  const long cycles = 1000 * (argc > 2 ? atol(argv[2]) : 10);
  rtpm_device_options options = RTPM_DEVICE_OPTIONS_INIT;
  rtpm_node* node = NULL;
  rtpm_device* device = NULL;
  struct timespec next;
  long cycle, touches = 0;

  options.hold_us = 50000; /* bridges a pause of this program; then the force ends */
  options.timeout_us = 100000;
  if (rtpm_node_open(NULL, &node) != RTPM_OK) return fail("no node");
  if (rtpm_device_open(node, name, &options, &device) != RTPM_OK) return fail(name);
  if (rtpm_device_acquire(device, 2000000) != RTPM_OK) return fail("no lease");
  clock_gettime(CLOCK_MONOTONIC, &next);
  for (cycle = 0; cycle < cycles; ++cycle) {
    rtpm_sample sample = RTPM_SAMPLE_INIT;
    double force[3] = {0, 0, 0};
    wait_for_cycle(&next);
    if (rtpm_device_read(device, &sample) != RTPM_OK) continue; /* the next one may come in time */
    if (sample.position_m[1] < 0) {
      force[1] = -kStiffness * sample.position_m[1];
      ++touches;
    }
    if (rtpm_device_set_wrench(device, force, NULL) == RTPM_NOT_HOLDER)
      return fail("the wall ends");
  }
  printf("%ld of %ld cycles in the wall\n", touches, cycles);
  rtpm_device_close(device);
  rtpm_node_close(node);
  return 0;
}
