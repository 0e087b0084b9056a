"""Read by mypy only: each line with an expected error has one."""

from generated.lab_rtpm import ArmClient, Drawing, Force


def misuse(arm: ArmClient) -> None:
    arm.set_force(3)  # expected: arg-type
    arm.set_force(Force(x="1"))  # expected: arg-type
    arm.set_force(Force(w=1))  # expected: call-arg
    arm.set_force()  # expected: call-arg
    arm.draw(Drawing())  # expected: call-arg
    arm.draw(Drawing(title="a", numbers="ab"))  # expected: arg-type
    arm.sing()  # expected: attr-defined
    arm.close(deadline="1")  # expected: arg-type
    len(arm.draw(Drawing(title="a")).mode)  # expected: arg-type
