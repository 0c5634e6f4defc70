use messages::{Part, Track, TrackState, TrackTable};

use crate::top::view::{TrackRow, TracksView};

/// The states, in the order in which they are shown.
const STATES: [TrackState; 3] = [TrackState::Confirmed, TrackState::Coasting, TrackState::Tentative];

/// What a part says of the tracks; none where its sweep goes on.
pub(super) fn view(part: &Part, table: &TrackTable) -> Option<TracksView> {
    if !part.is_last() {
        return None;
    }
    let count = |state| table.tracks.iter().filter(|track| track.state == state).count();
    Some(TracksView {
        sweep: Some(part.sweep),
        known: table.time_ns > 0,
        states: STATES.map(|state| (state.name(), count(state))).to_vec(),
        alerts: table.tracks.iter().filter(|track| track.alert != 0).count(),
        rows: table.tracks.iter().take(TracksView::MAX_ROWS).map(row).collect(),
    })
}

fn row(track: &Track) -> TrackRow {
    let approach = (track.state != TrackState::Tentative).then_some(track.approach);
    TrackRow {
        track: track.id,
        state: track.state.name(),
        class: track.class.name(),
        p: track.class.solid_index().and_then(|place| track.posterior.get(place).copied()),
        range_m: norm(track.position_m),
        speed_mps: norm(track.velocity_mps),
        age_sweeps: track.age_sweeps,
        last_seen_sweeps: track.last_seen_sweeps,
        time_s: approach.map(|approach| approach.time_s),
        distance_m: approach.map(|approach| approach.distance_m),
        collision_probability: approach.map(|approach| approach.collision_probability),
        alert: track.alert != 0,
    }
}

fn norm([x, y, z]: [f32; 3]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests {
    use lidar::ObstacleClass;
    use messages::ClosestApproach;
    use zerocopy::FromZeros;

    use super::*;

    #[test]
    fn tracks_are_shown_in_the_order_of_danger_and_their_states_are_counted() {
        let approach =
            ClosestApproach { time_s: 2.5, distance_m: 1.5, distance_sigma_m: 0.5, collision_probability: 0.25 };
        let mut table = TrackTable::new_box_zeroed().unwrap();
        table.time_ns = 1;
        let tracks = [(9, TrackState::Coasting, 1), (4, TrackState::Confirmed, 0), (7, TrackState::Tentative, 0)];
        for (id, state, alert) in tracks {
            let track = Track {
                id,
                state,
                alert,
                approach,
                class: ObstacleClass::Conical,
                posterior: [0.0, 0.0, 0.25, 0.75],
                position_m: [0.0, 3.0, 4.0],
                velocity_mps: [0.5, 0.0, 0.0],
                ..Track::default()
            };
            table.tracks.push(track).unwrap();
        }
        let part = |sector| Part { sweep: 3, sector, sectors: 2, ..Part::default() };
        assert_eq!(view(&part(0), &table), None, "more of the sweep is to come");
        let TracksView { sweep, known, states, alerts, rows } = view(&part(1), &table).unwrap();
        assert_eq!((sweep, known, alerts), (Some(3), true, 1));
        assert_eq!(states, [("confirmed", 1), ("coasting", 1), ("tentative", 1)]);
        assert_eq!(rows.iter().map(|row| row.track).collect::<Vec<_>>(), [9, 4, 7]);
        let row = &rows[0];
        assert_eq!((row.class, row.p, row.range_m, row.speed_mps, row.alert), ("conical", Some(0.75), 5.0, 0.5, true));
        assert_eq!((row.time_s, row.distance_m, row.collision_probability), (Some(2.5), Some(1.5), Some(0.25)));
        assert_eq!(rows[2].time_s, None, "nothing is said of a tentative track's way");
    }
}
