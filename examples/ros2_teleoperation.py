"""Drives an arm from ROS 2: a Twist on /cmd_vel moves a point, and a spring pulls the arm there.

This is a node of ROS 2, without RTPM; rtpm-ros2 passes its forces on, and the arm's poses back.
First, in another terminal: rtpm up examples/laboratory.toml

    rtpm-ros2 --command lab/arm1 &
    python3 examples/ros2_teleoperation.py &
    ros2 run teleop_twist_keyboard teleop_twist_keyboard      # or any other source of /cmd_vel
"""

import sys

import rclpy
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped, WrenchStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

RATE_HZ = 200.0
STIFFNESS = 100.0  # N/m
DAMPING = 4.0  # N s/m
REACH_M = 0.08  # Of the point; the arm's workspace is 0.1 m.
SCALE = 0.05  # /cmd_vel 1 m/s, as the keyboard sends it, moves the point by 50 mm/s.
PATIENCE_S = 0.5  # A velocity lasts so long without a newer one.


class Teleoperation(Node):
    """A point that /cmd_vel moves, and the force between it and the arm."""

    def __init__(self) -> None:
        super().__init__("rtpm_teleoperation")
        arm = self.declare_parameter("arm", "/rtpm/lab/arm1").value
        self.point = [0.0, 0.0, 0.0]
        self.velocity = [0.0, 0.0, 0.0]
        self.commanded_at = self.get_clock().now()
        self.pose: PoseStamped | None = None
        self.twist = TwistStamped()
        self.create_subscription(Twist, "cmd_vel", self.take_velocity, 10)
        self.create_subscription(PoseStamped, f"{arm}/pose", self.take_pose, 1)
        self.create_subscription(TwistStamped, f"{arm}/twist", self.take_twist, 1)
        self.wrenches = self.create_publisher(WrenchStamped, f"{arm}/command/wrench", 1)
        self.create_timer(1 / RATE_HZ, self.pull)
        self.get_logger().info(f"waits for {arm}/pose of rtpm-ros2 --command")

    def take_velocity(self, message: Twist) -> None:
        # In ROS x is forwards, y to the left. The arm's x is to the right, y up, z to the operator.
        linear = message.linear
        self.velocity = [-SCALE * linear.y, SCALE * linear.z, -SCALE * linear.x]
        self.commanded_at = self.get_clock().now()

    def take_pose(self, message: PoseStamped) -> None:
        if self.pose is None:
            at = message.pose.position
            self.point = [at.x, at.y, at.z]  # It begins where the arm is, without a force.
            self.get_logger().info("the arm is there; /cmd_vel moves it")
        self.pose = message

    def take_twist(self, message: TwistStamped) -> None:
        self.twist = message

    def pull(self) -> None:
        if self.pose is None:
            return
        now = self.get_clock().now()
        if (now - self.commanded_at).nanoseconds < PATIENCE_S * 1e9:
            moved = zip(self.point, self.velocity, strict=True)
            self.point = [max(-REACH_M, min(REACH_M, p + v / RATE_HZ)) for p, v in moved]
        at, speed = self.pose.pose.position, self.twist.twist.linear
        wrench = WrenchStamped()
        # The bridge drops commands of another frame, and old ones.
        wrench.header.frame_id = self.pose.header.frame_id
        wrench.header.stamp = now.to_msg()
        force = wrench.wrench.force
        force.x = STIFFNESS * (self.point[0] - at.x) - DAMPING * speed.x
        force.y = STIFFNESS * (self.point[1] - at.y) - DAMPING * speed.y
        force.z = STIFFNESS * (self.point[2] - at.z) - DAMPING * speed.z
        self.wrenches.publish(wrench)


def main() -> int:
    rclpy.init()
    try:
        rclpy.spin(Teleoperation())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # The bridge lets the force end.
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
