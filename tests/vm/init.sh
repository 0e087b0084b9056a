#!/bin/busybox sh
# The guest's first process: prepares it, runs the tests of /tests/list, each with its deadline,
# prints their output between @begin and @end on the second serial port, and powers off.
export PATH=/bin:/sbin:/tests HOME=/tmp
/bin/busybox --install -s /bin
mount -t proc proc /proc
mount -t sysfs sysfs /sys
mount -t devtmpfs devtmpfs /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts devpts /dev/pts
mount -t tmpfs tmpfs /dev/shm
mount -t tmpfs tmpfs /tmp
mount -t tmpfs tmpfs /run
stty -F /dev/ttyS1 raw -echo
exec </dev/null >/dev/ttyS1 2>&1
uname -srv
ip link set lo up
hostname guest

ln -s udevadm /bin/systemd-udevd
systemd-udevd --daemon || echo "udevd did not start"
# Drivers for single makes, such as hid-logitech, take devices of usbhid only, not of uhid.
modprobe hid ignore_special_drivers=1
while read -r module; do
  modprobe "$module" || echo "the module $module is missing"
done </tests/modules
udevadm trigger --action=add --subsystem-match=misc --subsystem-match=usb
udevadm settle

# Hundredths of a second since the start.
now() { read -r time rest </proc/uptime; echo "${time%.*}${time#*.}"; }

while read -r deadline program name; do
  echo "@begin $name"
  begin=$(now)
  timeout -s KILL "$deadline" "$program" --gtest_filter="$name" --gtest_color=no
  exit_code=$?
  [ $exit_code = 0 ] || dmesg | tail -n 8
  # Of a test that was killed, its programs remain.
  killall -q -KILL rtpm-registryd rtpm-deviced
  printf '\n@end %s %d %d\n' "$name" "$exit_code" $(($(now) - begin))
done </tests/list
echo "@done"
sync
poweroff -f
