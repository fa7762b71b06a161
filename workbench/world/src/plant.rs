//! The faults that are planted between the cores, to see whether the oracles find them: a row for each promise.

/// A planted fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plant {
    /// None.
    Nothing,
    /// An order is as old as its arrival.
    StampedByReader,
    /// A copy is an order of its own.
    CopyIsNew,
    /// No step names the one before.
    NoStep,
    /// Nobody tells the bridge of the end of a process, and every lease is renewed.
    SendersLiveForEver,
    /// What may begin until a moment may begin a minute later.
    NoMoment,
    /// Only a take-off may.
    NoMomentOfTakeOff,
    /// A step whose predecessor was refused names none.
    AfterRefused,
    /// With any process the sender of the path ends.
    WrongProcess,
    /// Whose sender is to be followed by a landing is held.
    HoldsForLand,
    /// The bridge does not learn that the machine was suspended.
    SleepIsNothing,
    /// The bridge has no fence.
    NoFence,
    /// A final report of the bridge is lost.
    ReportIsLost,
    /// A report of the bridge is said twice.
    ReportIsTwice,
    /// The relay of a station takes an order for as old as its arrival there.
    StationStamps,
    /// It says that an order is older than it can be.
    StationIsOld,
    /// It says that its robot's clock is known exactly.
    NoUncertainty,
    /// It hands on no moment until which an order may begin.
    StationDropsMoment,
    /// It hands an order on to another robot.
    WrongRobot,
    /// It gives a client the final report twice.
    StationSaysTwice,
    /// It gives a client none.
    StationSaysNothing,
    /// It calls done what it does not know.
    StationInvents,
    /// It does not notice that a client is gone.
    StationKeepsClient,
    /// The relay of a robot passes each order on once more, as a new one.
    RelayCopies,
    /// It passes orders of a station on, of which the bridge reports nothing to it.
    RelayIsDeaf,
    /// It does not notice that a station is silent.
    NoLinkLoss,
    /// A sample at a station is as old as its arrival.
    SampleIsNew,
    /// A sample that was overtaken is published all the same.
    SampleOvertakes,
    /// A sample of a relay that has ended is published.
    SampleOfFormer,
    /// A sample at a station is that of another robot.
    SampleOfOther,
    /// Ages at a station are right to nothing but a second.
    ClockIsWrong,
    /// Status says the values of the sample before.
    StatusIsLate,
    /// Status says that a sample was received when it reads it.
    StatusStamps,
    /// The gateway of MAVLink takes a datagram for as old as its reading.
    GatewayStamps,
    /// It takes each datagram as one of another station, too.
    GatewayCopies,
    /// It is told that the bridge accepts what it refuses.
    GatewayFlatters,
    /// It takes a sample for one of now.
    GatewayKeepsYoung,
    /// It shows another place.
    GatewayPlace,
    /// The recorder is not given a sample that its subscriber has counted.
    RecordMisses,
    /// It is given one with another value.
    RecordChanges,
    /// It is given one twice.
    RecordsTwice,
    /// The disk says that it has written what it has not.
    DiskLies,
    /// The view takes an order of a page for as old as its reading.
    ViewStamps,
    /// Only a hold and a landing.
    ViewStampsCalm,
    /// It takes a page for one that has drawn the newest values.
    ViewForgetsSeen,
    /// It takes a copy of an order for another one.
    ViewTakesCopies,
    /// It lets what a page has ordered go on without a page.
    ViewNeverHolds,
    /// It does not notice that a page is there.
    ViewIsDeserted,
    /// It says nothing of how an order ends.
    ViewSaysNothing,
    /// It says it twice, in other words.
    ViewSaysTwice,
    /// It calls done what was replaced.
    ViewInvents,
    /// It takes a sample for as old as its reading.
    ViewKeepsYoung,
    /// It shows another place.
    ViewPlace,
    /// A station is told that its mission is accepted before that is on the disk.
    MissionAcksEarly,
    /// The gateway that begins again does not know how far the mission was.
    MissionForgets,
    /// A step of a mission names none before.
    MissionForgetsStep,
    /// The gateway lets the path of a station go on that it does not hear.
    GatewayKeepsLost,
    /// The relay of a robot does not tell the bridge that a client has given up.
    RelayKeepsGivenUp,
    /// A write may be sent a minute after its moment.
    NoMomentOfWrite,
    /// A copy of a write is one of its own.
    ParameterCopies,
    /// What the bridge says of a port is another value.
    ParameterInvents,
    /// The gateway takes an older value of a station once more when a newer one comes.
    GatewayWritesOld,
    /// No step of a plan names the one before.
    PlanForgetsStep,
}

/// All of them, a seed in whose run each is found, and the promise that it breaks.
#[rustfmt::skip]
pub const PLANTS: [(Plant, u64, &str); 62] = [
    (Plant::StampedByReader, 18, "the last order holds, by its issue"),
    (Plant::CopyIsNew, 2, "an order is executed once"),
    (Plant::NoStep, 2, "nothing comes between two steps"),
    (Plant::SendersLiveForEver, 21, "no order lives on without its sender"),
    (Plant::NoMoment, 9, "nothing begins after its moment"),
    (Plant::NoMomentOfTakeOff, 9, "no take-off begins after its moment"),
    (Plant::AfterRefused, 23, "no step follows one that was refused"),
    (Plant::WrongProcess, 37, "no order ends with another's sender"),
    (Plant::HoldsForLand, 80, "what follows a lost sender is what its order says"),
    (Plant::SleepIsNothing, 536, "no path goes on after a suspension"),
    (Plant::NoFence, 38, "nothing is flown outside the fence"),
    (Plant::ReportIsLost, 2, "each request has a final report"),
    (Plant::ReportIsTwice, 2, "each request has one final report"),
    (Plant::StationStamps, 2, "an order of a station does not get younger"),
    (Plant::StationIsOld, 1, "an order that nothing has outdated is taken"),
    (Plant::NoUncertainty, 1, "the last order holds, however well clocks are known"),
    (Plant::StationDropsMoment, 108, "nothing of a station begins after its moment"),
    (Plant::WrongRobot, 6, "an order reaches the robot that it is for"),
    (Plant::StationSaysTwice, 1, "a client of a station has one final report"),
    (Plant::StationSaysNothing, 2, "a client of a station has a final report"),
    (Plant::StationInvents, 1, "a client of a station has the true report"),
    (Plant::StationKeepsClient, 471, "no path goes on whose client at a station is gone"),
    (Plant::RelayCopies, 1017, "an order of a station is executed once"),
    (Plant::RelayIsDeaf, 6, "what a station's client is told is what the bridge said"),
    (Plant::NoLinkLoss, 408, "no path of a lost station goes on where link_loss forbids it"),
    (Plant::SampleIsNew, 1, "an age is not younger than it is"),
    (Plant::SampleOvertakes, 1, "the newest sample counts"),
    (Plant::SampleOfFormer, 139, "the newest sample counts, whoever has sent it"),
    (Plant::SampleOfOther, 1, "what a station shows is what that robot published"),
    (Plant::ClockIsWrong, 1, "an age is true within what is said of it"),
    (Plant::StatusIsLate, 0, "what a consumer reads is what is true then"),
    (Plant::StatusStamps, 7, "an age on the robot is not younger than it is"),
    (Plant::GatewayStamps, 590, "a command of MAVLink does not get younger"),
    (Plant::GatewayCopies, 21, "a command of MAVLink is executed once"),
    (Plant::GatewayFlatters, 6, "an answer over MAVLink is what the bridge said"),
    (Plant::GatewayKeepsYoung, 95, "nothing is sent of a helicopter that is not heard"),
    (Plant::GatewayPlace, 6, "what a MAVLink station shows is where it is"),
    (Plant::RecordMisses, 2, "a record has all that was published to it"),
    (Plant::RecordChanges, 2, "a record has what was published"),
    (Plant::RecordsTwice, 5, "a record has each sample once"),
    (Plant::DiskLies, 2, "what was flushed before a kill is in the record"),
    (Plant::ViewStamps, 28, "an order of a page is as old as what it had drawn"),
    (Plant::ViewStampsCalm, 28, "no hold that has waited ends what was ordered since"),
    (Plant::ViewForgetsSeen, 28, "no movement is ordered by an old picture"),
    (Plant::ViewTakesCopies, 28, "an order of a page is executed once"),
    (Plant::ViewNeverHolds, 448, "no path of a page goes on without a page"),
    (Plant::ViewIsDeserted, 42, "nothing ends that a page commands"),
    (Plant::ViewSaysNothing, 28, "each press has a final report"),
    (Plant::ViewSaysTwice, 28, "each press has one final report"),
    (Plant::ViewInvents, 39, "a page is told what the bridge said"),
    (Plant::ViewKeepsYoung, 0, "what a page shows is not younger than it is"),
    (Plant::ViewPlace, 0, "what a page shows was true then"),
    (Plant::MissionAcksEarly, 10, "a mission that is accepted is kept"),
    (Plant::MissionForgets, 21, "a mission goes on with the item that was not reached"),
    (Plant::MissionForgetsStep, 256, "no item of a mission goes after a newer order"),
    (Plant::GatewayKeepsLost, 104, "no path goes on whose station of MAVLink is lost"),
    (Plant::RelayKeepsGivenUp, 471, "no request lives on that its client has given up"),
    (Plant::NoMomentOfWrite, 106, "no port is written after the moment of its request"),
    (Plant::ParameterCopies, 11, "a port is written once"),
    (Plant::ParameterInvents, 1, "what is told of a port is its value"),
    (Plant::GatewayWritesOld, 104, "no value of a MAVLink station is written over a newer one"),
    (Plant::PlanForgetsStep, 118, "no step of a plan goes after a newer order"),
];
