#include <rtpm/rtpm.h>
#include <stdio.h>

int main(void) {
  rtpm_node *node;
  if (rtpm_node_open(NULL, &node) != RTPM_OK) {
    fprintf(stderr, "%s\n", rtpm_last_error());
    return 1;
  }
  printf("RTPM %x from C\n", (unsigned)rtpm_version());
  rtpm_node_close(node);
  return 0;
}
