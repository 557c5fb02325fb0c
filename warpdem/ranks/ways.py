"""Which way the messages of a run over ranks go: within the loop of a CPU, through memory of the host, or from GPU to GPU."""

from dataclasses import dataclass

import warp as wp

from warpdem.core.log import log
from warpdem.engine.cpu import CpuExecutor
from warpdem.engine.engine import Engine
from warpdem.engine.graph_of_stages import StageExecutor
from warpdem.engine.graph_of_steps import STEPS, StepsExecutor
from warpdem.model.model import Model
from warpdem.ranks.device_exchange import DeviceExchange
from warpdem.ranks.device_messages import DeviceMessages, nccl_messages
from warpdem.ranks.exchange import Exchange
from warpdem.ranks.staging import StagedExchange
from warpdem.ranks.world import World

AnyExchange = Exchange | DeviceExchange


def messages_of(world: World, device: wp.Device) -> tuple[DeviceMessages | None, str]:
    """What carries messages between the devices of the ranks; None where nothing does, and why. On all ranks together."""
    return nccl_messages(world, device)


@dataclass(frozen=True)
class Way:
    """A way of the messages.

    Attributes:
        executor: what runs the steps.
        text: what it is, and why it is not another one.
        messages: what carries them from GPU to GPU; None where they do not go so.
    """

    executor: type[CpuExecutor] | type[StageExecutor] | type[StepsExecutor]
    text: str
    messages: DeviceMessages | None = None

    def exchange(self, world: World, engine: Engine) -> AnyExchange:
        """The exchange of a rank, known to what runs its steps."""
        executor, batch = engine.executor, engine.batch
        exchange: AnyExchange
        if isinstance(executor, CpuExecutor):
            exchange = Exchange(world, batch.stages)
            executor.exchange = exchange.address
        elif isinstance(executor, StageExecutor):
            exchange = staged = StagedExchange(world, batch.stages, batch.report.moved)
            executor.exchange = staged.after_stage
        else:
            assert isinstance(executor, StepsExecutor) and self.messages is not None
            exchange = executor.messages = DeviceExchange(self.messages, batch.report.moved, batch.stages)
            # graphs that hold messages go before what carries these
            world.at_end += [executor.forget, self.messages.close]
        if engine.moves_walls:
            exchange.loads = batch.control.dynamic.sums
        return exchange


def way_of(world: World, model: Model) -> Way:
    """The way for a model, the same on all ranks, which are asked where steps run as launches.

    Raises:
        WarpdemError: a rank has failed before it came here, with its error.
    """
    if not model.features.backend.resident:
        return Way(CpuExecutor, "MPI from within the steps")
    world.raise_first(None)  # who has failed is not here to agree with the others
    messages, why = messages_of(world, model.device)
    if messages is None:
        way = Way(StageExecutor, f"MPI through memory of the host after each stage ({why})")
    else:
        way = Way(StepsExecutor, f"{messages.name} from device to device, in graphs of {STEPS} steps", messages)
    if world.rank == 0:
        log.info("ranks exchange by %s", way.text)
    return way
