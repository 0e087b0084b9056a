"""Read by mypy only: what the generated types allow."""

from generated.lab_rtpm import (
    ArmAsyncClient,
    ArmClient,
    ArmServant,
    Circle,
    Drawing,
    Force,
    Mode,
    Square,
)


def use(arm: ArmClient) -> float:
    arm.set_force(Force(0, 0, z=1.5), priority=24000, deadline=0.001)
    drawing = arm.draw(
        Drawing(title="a", shape=Circle(radius_m=1), numbers=[1.0], mode=Mode.Follow)
    )
    arm.close()
    match drawing.shape:
        case Circle(radius_m=radius):
            return radius
        case Square(side_m=side):
            return side
        case _:
            return (-2 * Force(1, 2, 3)).x


async def use_async(arm: ArmAsyncClient) -> str:
    await arm.set_force(Force(0, 0, 1.5))
    return (await arm.draw(Drawing(title="a"), deadline=1)).title


class Arm(ArmServant):
    def set_force(self, request: Force, /) -> None:
        self.force = request

    async def draw(self, request: Drawing, /) -> Drawing:
        return request

    def close(self) -> None:
        pass
