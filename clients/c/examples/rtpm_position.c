/*
 * Position and force of a device as a function of Octave and MATLAB:
 *   mkoctfile --mex rtpm_position.c -lrtpm-c       or, in MATLAB:  mex rtpm_position.c -lrtpm-c
 *   [position_m, force_newton] = rtpm_position('lab/arm0')
 * The device stays open until another name is given or the function is cleared.
 */
#include <string.h>

#include <mex.h>
#include <rtpm/rtpm.h>

static rtpm_node* node = NULL;
static rtpm_device* device = NULL;
static char open_name[256] = "";

static void close_all(void) {
  rtpm_device_close(device);
  rtpm_node_close(node);
  device = NULL;
  node = NULL;
  open_name[0] = '\0';
}

static void open_device(const char* name) {
  rtpm_device_options options = RTPM_DEVICE_OPTIONS_INIT;
  options.timeout_us = 1000000; /* an interpreter is no loop of 1 kHz */
  close_all();
  if (rtpm_node_open(NULL, &node) != RTPM_OK ||
      rtpm_device_open(node, name, &options, &device) != RTPM_OK) {
    close_all();
    mexErrMsgIdAndTxt("rtpm:open", "%s", rtpm_last_error());
  }
  strcpy(open_name, name);
}

static mxArray* row_of(const double values[3]) {
  mxArray* row = mxCreateDoubleMatrix(1, 3, mxREAL);
  memcpy(mxGetPr(row), values, 3 * sizeof(double));
  return row;
}

void mexFunction(int result_count, mxArray* results[], int argument_count,
                 const mxArray* arguments[]) {
  rtpm_sample sample = RTPM_SAMPLE_INIT;
  char name[sizeof open_name];
  if (argument_count != 1 || !mxIsChar(arguments[0]) ||
      mxGetString(arguments[0], name, sizeof name) != 0)
    mexErrMsgIdAndTxt("rtpm:usage", "rtpm_position takes the name of a device, as 'lab/arm0'");
  mexAtExit(close_all);
  if (strcmp(name, open_name) != 0) open_device(name);
  if (rtpm_device_read(device, &sample) != RTPM_OK)
    mexErrMsgIdAndTxt("rtpm:read", "%s: %s", name, rtpm_last_error());
  results[0] = row_of(sample.position_m);
  if (result_count > 1) results[1] = row_of(sample.force_newton);
}
