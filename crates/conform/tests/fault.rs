//! What is wrong with a DSP: one sentence of docs/protocol.md that it breaks, and the check that must name it.

use Fault::*;
use dsp_protocol::{Group, Profile};

/// A fault of the small DSP; a right one has [`Fault::None`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    None,
    // Bytes and frames.
    TakesAnyCheckField,
    NamesAnotherErrorForCheckField,
    SilentAboutCheckField,
    AcknowledgesDamaged,
    TakesAnyPadding,
    JudgesPaddingFirst,
    SilentAboutHeaders,
    CountsEachByte,
    ReportsStrays,
    ReportsTruncated,
    IgnoresHeadersWithin,
    GivesUpWithin(u64),
    AcknowledgesUnknownCommands,
    ChecksUnknownCommands,
    SilentAboutUnknownCommands,
    ReceivesOnly(usize),
    TakesHeadersWithoutBit7,
    LosesFirstFrameBehindNoise,
    TakesDamagedWrites,
    TakesAnyFollowing,
    // Acknowledgements.
    NoAckOf(u8),
    AcksTwice,
    NamesAnotherCommand,
    AcksReadsWithoutData,
    AcksWordsForFloats,
    AcksAfter(u64),
    StatusBeforeAck,
    WritesLate,
    RefusesInSilence,
    RefusesWithoutAck,
    // What the DSP sends.
    SendsWrongCheckField,
    AlwaysSendsWrongCheckField,
    SetsPadding,
    SetsAnotherFlag,
    SendsBytesBetween,
    BreaksStatusOff,
    AnswersInOtherProfile,
    // Status.
    PeriodFactor(u32),
    PeriodTooLong,
    SendsNoStatus,
    NewPeriodAtOnce,
    KeepsOldPeriod,
    CountsNewPeriodFromNow,
    ActivateRestarts,
    ActivateSwitches,
    IgnoresMask,
    AddsGroup,
    NoTime,
    TimeWithoutMask,
    TimeIn(u32),
    TimeStands,
    ClockStops,
    WrapResets,
    QueuesStatuses,
    Implausible(Group),
    LeavesOut(Group),
    WrongLength(Group),
    GravityUp,
    // Ports.
    TakesBeyond(u16),
    RefusesEnd(u16),
    BootsWith(u16),
    ReadsConsume,
    UnknownReadsOne,
    SilentAboutUnknownReads,
    SilentAboutUnknownWrites,
    MixesWidths,
    CountWithoutBit15,
    CountIsWritable,
    KeepsTimeoutWrong,
    ReadsOtherRange(u16),
    // Errors.
    NewestErrorFirst,
    TwoErrorsForStatus,
    ErrorsAtOnce,
    ErrorPlaces(usize),
    DropsOldestError,
    KeepsErrors,
    AckBeforeError,
    AckForError,
    // The extended profile.
    NumberStands,
    SkipsNumbers,
    AcksNumberZero,
    ExecutesCopies,
    SilentAboutCopies,
    CopiesByNumber,
    CopiesByBytes,
    WantsNextNumber,
    ChecksCrcBeforeKind,
    IgnoresTopOfCrc,
    OtherProfileWaits,
    OtherProfileAlways,
    OtherProfileSilent,
    TakesWaypointCopies,
    KeepsWaypointNumber,
    TimeoutKeepsWaypointNumber,
    RefusedWaypointLeavesNumber,
    ReadsCopiesAnew,
    // Boot.
    SendsAtBoot,
    ActiveAtBoot,
    FirstStatusAtOnce,
    KeepsMask,
    KeepsClock,
    KeepsNumbers,
    CountsFromFive,
    TakesOffWithoutStartUp,
    ActivateStartsFlow,
    // Flow control, waypoints, flight.
    AsksOnGround,
    FirstFlowAtOnce,
    FollowingRestarts,
    FlowAfterOff,
    SilentAboutWaypointsOnGround,
    SilentAboutLandOnGround,
    AnyValueMoves,
    TakeOffReadsZero,
    RefusesTakeOffAgain,
    LandsDuringTakeOff,
    TakesWaypointsDuringTakeOff,
    FlowBeforeFlag,
    TakeOffReadsOneForever,
    TakeOffReadsZeroAtHeight,
    ClimbsToTen,
    RefusesInvalidateDuringTakeOff,
    CountsNothing,
    Places(usize),
    FullIs(u16),
    FreePlaces(usize),
    InvalidateKeepsPath,
    FollowingOffKeepsPath,
    TakesEqualWaypoints,
    EqualByPosition,
    TakesAnyWaypoint,
    RefusesWaypointAtLimit,
    TakesLowWaypoints,
    ReachedStays,
    NoTimeout,
    TimeoutFactor(f64),
    TimeoutIgnoresReads,
    TimeoutIgnoresWaypoints,
    TimeoutIgnoresRefused,
    TimeoutWhenOff,
    LandReadsZero,
    RefusesLandAgain,
    TakesOffDuringLanding,
    AsksDuringLanding,
}

/// A wrong DSP: its fault, the check that must be broken, and in which profile it is played.
pub struct Mutant {
    pub fault: Fault,
    pub check: String,
    pub profile: Profile,
}

fn mutant(profile: Profile, fault: Fault, check: impl Into<String>) -> Mutant {
    Mutant {
        fault,
        check: check.into(),
        profile,
    }
}

/// All wrong DSPs.
pub fn mutants() -> Vec<Mutant> {
    use Profile::{Classic, Extended};
    let mut mutants = Vec::new();
    for (fault, check) in both() {
        mutants.push(mutant(Classic, fault, check));
        mutants.push(mutant(Extended, fault, check));
    }
    for (fault, check) in extended() {
        mutants.push(mutant(Extended, fault, check));
    }
    for group in Group::ALL {
        let name = group.name();
        if group != Group::Time {
            mutants.push(mutant(Classic, Implausible(group), format!("9-{name}")));
        }
        mutants.push(mutant(Classic, WrongLength(group), format!("4.1-{name}")));
    }
    for number in [
        10_001, 10_002, 10_004, 10_200, 10_201, 10_202, 10_203, 10_204, 10_210,
    ] {
        let check = format!("6-port-{number}");
        mutants.push(mutant(Classic, TakesBeyond(number), check.clone()));
        mutants.push(mutant(Extended, RefusesEnd(number), check));
    }
    for number in [
        20_000, 20_001, 20_002, 20_010, 20_011, 20_012, 20_013, 20_121,
    ] {
        let check = format!("6-port-{number}");
        mutants.push(mutant(Extended, TakesBeyond(number), check.clone()));
        mutants.push(mutant(Classic, RefusesEnd(number), check));
    }
    for number in [10_200, 10_204, 10_210, 20_010, 20_013] {
        let check = format!("6-read-{number}");
        mutants.push(mutant(Classic, ReadsOtherRange(number), check));
    }
    for number in [10_001, 10_002, 10_210, 20_000, 20_121] {
        mutants.push(mutant(Classic, BootsWith(number), "6-at-boot"));
    }
    for (code, check) in [
        "5.1-read-16",
        "5.1-write-16",
        "5.1-read-32",
        "5.1-write-32",
        "5.1-clear-errors",
        "5.1-activate-status",
        "5.1-invalidate-path",
        "5.1-following-off",
    ]
    .into_iter()
    .enumerate()
    {
        mutants.push(mutant(Classic, NoAckOf(code as u8), check));
    }
    mutants.push(mutant(Classic, SendsWrongCheckField, "2-checksum"));
    mutants.push(mutant(Extended, SendsWrongCheckField, "11-crc"));
    mutants
}

/// The faults of both profiles.
fn both() -> Vec<(Fault, &'static str)> {
    vec![
        (TakesAnyCheckField, "5.1-damaged-byte"),
        (NamesAnotherErrorForCheckField, "5.1-damaged-byte"),
        (SilentAboutCheckField, "5.1-damaged-byte"),
        (AcknowledgesDamaged, "5.1-damaged-byte"),
        (TakesAnyPadding, "5.1-padding"),
        (JudgesPaddingFirst, "2-order-of-judgement"),
        (SilentAboutHeaders, "2-unknown-header"),
        (SilentAboutHeaders, "5.1-damaged-header"),
        (CountsEachByte, "2-unknown-header"),
        (ReportsStrays, "2-stray"),
        (ReportsTruncated, "5.1-truncated"),
        (IgnoresHeadersWithin, "2-gained-bit-7"),
        (GivesUpWithin(10), "1-bytes-apart"),
        (GivesUpWithin(1_000), "2-no-timeout-within-frame"),
        (AcknowledgesUnknownCommands, "5.1-unknown-command"),
        (ChecksUnknownCommands, "5.1-unknown-command"),
        (SilentAboutUnknownCommands, "5.1-unknown-command"),
        (ReceivesOnly(24), "8.2-burst"),
        (TakesHeadersWithoutBit7, "2-lost-bit-7"),
        (LosesFirstFrameBehindNoise, "2-resynchronise"),
        (TakesDamagedWrites, "2-damaged-write"),
        (TakesAnyFollowing, "5.1-following-on"),
        (AcksTwice, "8.2-one-acknowledgement"),
        (NamesAnotherCommand, "5.1-write-16"),
        (AcksReadsWithoutData, "5.1-read-16"),
        (AcksWordsForFloats, "5.1-read-32"),
        (AcksAfter(90), "8.2-ack-time"),
        (StatusBeforeAck, "8.2-ack-before-status"),
        (WritesLate, "8.2-write-then-read"),
        (RefusesInSilence, "8.2-refused-command"),
        (RefusesWithoutAck, "8.2-refused-command"),
        (SetsPadding, "3-padding"),
        (SetsAnotherFlag, "4.1-values"),
        (SendsBytesBetween, "2-frames"),
        (BreaksStatusOff, "2-frames"),
        (AnswersInOtherProfile, "11-profile"),
        (PeriodFactor(2), "8.3-period"),
        (PeriodTooLong, "8.3-period"),
        (SendsNoStatus, "8.3-period"),
        (NewPeriodAtOnce, "8.3-shorter-period"),
        (KeepsOldPeriod, "8.3-shorter-period"),
        (CountsNewPeriodFromNow, "8.3-longer-period"),
        (ActivateRestarts, "8.3-activate-again"),
        (ActivateSwitches, "8.3-activate-again"),
        (IgnoresMask, "4.1-mask"),
        (AddsGroup, "4.1-mask"),
        (NoTime, "4.1-time"),
        (TimeWithoutMask, "8.3-no-group"),
        (TimeIn(10), "8.3-time-counts-ms"),
        (TimeStands, "8.3-time-rises"),
        (ClockStops, "8.3-clock-wraps"),
        (WrapResets, "8.3-clock-wraps"),
        (QueuesStatuses, "8.3-left-out"),
        (LeavesOut(Group::Time), "4.1-time"),
        (GravityUp, "4.1-specific-force"),
        (ReadsConsume, "6-read-keeps"),
        (UnknownReadsOne, "6-unknown-read"),
        (SilentAboutUnknownReads, "6-unknown-read"),
        (SilentAboutUnknownWrites, "6-unknown-write"),
        (MixesWidths, "6-unknown-write"),
        (CountWithoutBit15, "6-read-only"),
        (CountIsWritable, "6-read-only"),
        (KeepsTimeoutWrong, "8.1-start-up"),
        (NewestErrorFirst, "8.6-oldest-first"),
        (TwoErrorsForStatus, "8.6-behind-status"),
        (ErrorsAtOnce, "8.6-behind-status"),
        (ErrorPlaces(8), "8.6-sixteen-places"),
        (ErrorPlaces(32), "8.6-sixteen-places"),
        (DropsOldestError, "8.6-sixteen-places"),
        (KeepsErrors, "8.6-clear-errors"),
        (AckBeforeError, "8.6-before-acknowledgements"),
        (AckForError, "8.6-before-acknowledgements"),
        (OtherProfileWaits, "11-other-profile"),
        (OtherProfileAlways, "11-other-profile"),
        (OtherProfileSilent, "11-other-profile"),
        (SendsAtBoot, "8.1-boot-silent"),
        (ActiveAtBoot, "8.1-boot-inactive"),
        (FirstStatusAtOnce, "8.3-first-status"),
        (KeepsMask, "8.1-boot-mask"),
        (KeepsClock, "8.1-boot-clock"),
        (CountsFromFive, "6-count-at-boot"),
        (TakesOffWithoutStartUp, "8.5-take-off-before-start-up"),
        (ActivateStartsFlow, "8.5-take-off-before-start-up"),
        (AsksOnGround, "8.4-flow-control"),
        (FirstFlowAtOnce, "8.4-flow-control"),
        (FollowingRestarts, "8.4-flow-control"),
        (FlowAfterOff, "8.5-no-flow-control"),
        (SilentAboutWaypointsOnGround, "8.4-waypoint-on-ground"),
        (SilentAboutLandOnGround, "8.5-land-on-ground"),
        (AnyValueMoves, "8.5-other-value"),
        (TakeOffReadsZero, "8.5-take-off-begins"),
        (RefusesTakeOffAgain, "8.5-take-off-again"),
        (LandsDuringTakeOff, "8.5-land-during-take-off"),
        (TakesWaypointsDuringTakeOff, "8.5-waypoint-during-take-off"),
        (FlowBeforeFlag, "8.5-flag"),
        (TakeOffReadsOneForever, "8.5-take-off-ends"),
        (TakeOffReadsZeroAtHeight, "8.5-take-off-ends"),
        (ClimbsToTen, "8.5-height"),
        (
            RefusesInvalidateDuringTakeOff,
            "8.4-invalidate-during-take-off",
        ),
        (CountsNothing, "8.4-taken"),
        (Places(15), "8.4-sixteen-places"),
        (Places(20), "8.4-sixteen-places"),
        (FullIs(30), "8.4-sixteen-places"),
        (FullIs(0), "8.4-sixteen-places"),
        (FreePlaces(1), "8.4-two-free-places"),
        (FreePlaces(3), "8.4-two-free-places"),
        (InvalidateKeepsPath, "8.4-invalidate-path"),
        (FollowingOffKeepsPath, "8.4-following-off-empties"),
        (TakesEqualWaypoints, "8.4-equal-waypoint"),
        (EqualByPosition, "8.4-equal-waypoint"),
        (TakesAnyWaypoint, "9-waypoint-limits"),
        (RefusesWaypointAtLimit, "9-waypoint-limits"),
        (TakesLowWaypoints, "8.4-too-low"),
        (ReachedStays, "8.4-reached"),
        (NoTimeout, "8.8-pc-timeout"),
        (TimeoutFactor(0.8), "8.8-pc-timeout"),
        (TimeoutFactor(2.0), "8.8-pc-timeout"),
        (TimeoutIgnoresReads, "8.8-sign-of-life"),
        (TimeoutIgnoresWaypoints, "8.8-waypoint-sign-of-life"),
        (TimeoutIgnoresRefused, "8.8-waypoint-sign-of-life"),
        (TimeoutWhenOff, "8.8-off"),
        (LandReadsZero, "8.5-landing-begins"),
        (RefusesLandAgain, "8.5-landing-again"),
        (TakesOffDuringLanding, "8.5-landing-again"),
        (AsksDuringLanding, "8.5-landing-empties"),
    ]
}

/// The faults of the extended profile.
fn extended() -> Vec<(Fault, &'static str)> {
    vec![
        (NumberStands, "11-sequence"),
        (SkipsNumbers, "11-sequence"),
        (AcksNumberZero, "11-acknowledged-number"),
        (ExecutesCopies, "11-copy"),
        (SilentAboutCopies, "11-copy"),
        (CopiesByNumber, "11-other-bytes"),
        (CopiesByBytes, "11-new-number"),
        (WantsNextNumber, "11-any-number"),
        (ChecksCrcBeforeKind, "11-kind"),
        (IgnoresTopOfCrc, "11-crc-of-the-pc"),
        (TakesWaypointCopies, "11-waypoint-copy"),
        (KeepsWaypointNumber, "11-number-forgotten"),
        (TimeoutKeepsWaypointNumber, "11-number-forgotten"),
        (RefusedWaypointLeavesNumber, "11-refused-number"),
        (ReadsCopiesAnew, "11-copy-of-read"),
        (KeepsNumbers, "11-first-number"),
    ]
}
