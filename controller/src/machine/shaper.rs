//! `[shaper]`: vibrations of the machine that its setpoints are not to excite.

use std::time::Duration;
use syncline_strict_toml::{Log, Table};
use syncline_trajectory::shaper::{Kind, Method, Shaper, Vibration};
use toml::Spanned;

/// As files name them.
const KINDS: [(&str, Kind); 4] = [
    ("zv", Kind::Zv),
    ("zvd", Kind::Zvd),
    ("ei", Kind::Ei),
    ("two_hump_ei", Kind::TwoHumpEi),
];

/// The same of what of a motion is shaped.
const METHODS: [(&str, Method); 2] = [
    ("clock", Method::Clock),
    ("coordinates", Method::Coordinates),
];

/// Most vibrations of one shaper, whose parts are multiplied by each.
const MOST_MODES: usize = 3;

/// Lowest frequency, Hz.
const LEAST_FREQUENCY: f64 = 0.5;

/// Highest frequency, of that of SYNC: beyond it the parts would come at the wrong times.
const MOST_FREQUENCY: f64 = 0.1;

/// What a file says of it.
pub(super) struct ShaperTable {
    kind: Kind,
    modes: Spanned<Vec<[f64; 2]>>,
    /// `None`: what the mode of each move says.
    pub(super) method: Option<Method>,
}

impl ShaperTable {
    pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Self> {
        let names = KINDS.iter().map(|(name, _)| *name);
        let kind = table.choice(log, "kind", names);
        let allowed = format!(
            "[[frequency, damping], …], one to {MOST_MODES}, in ascending order of frequency: from {LEAST_FREQUENCY} \
             Hz, damping ratios from 0 to 0.3"
        );
        let accept = |[frequency, damping]: [f64; 2]| {
            frequency >= LEAST_FREQUENCY && (0.0..=0.3).contains(&damping)
        };
        let modes = table.points(log, "modes", &allowed, accept);
        if let Some(modes) = &modes
            && !(1..=MOST_MODES).contains(&modes.get_ref().len())
        {
            let title = format!("shaper: {} `modes`", modes.get_ref().len());
            log.report(modes.span(), title, format!("allowed: {allowed}"));
        }
        let methods = METHODS.iter().map(|(name, _)| *name);
        let method = table.choice_if(log, "method", methods);
        table.finish(log);
        let method = method.and_then(|it| {
            let mut methods = METHODS.iter();
            methods.find(|(name, _)| name == it.get_ref())
        });
        let kind = kind?.into_inner();
        let (_, kind) = *KINDS.iter().find(|(name, _)| *name == kind)?;
        Some(Self {
            kind,
            modes: modes?,
            method: method.map(|(_, method)| *method),
        })
    }

    /// The shaper, in a machine with that cycle.
    pub(super) fn join(&self, log: &mut Log<'_>, cycle: Duration) -> Shaper {
        let most = MOST_FREQUENCY / cycle.as_secs_f64();
        let mut frequencies = self.modes.get_ref().iter().map(|[frequency, _]| frequency);
        if let Some(frequency) = frequencies.find(|&&frequency| frequency > most) {
            log.report(
                self.modes.span(),
                format!(
                    "shaper: a mode of {frequency} Hz with `cycle_us` at {}",
                    cycle.as_micros()
                ),
                format!("allowed: up to a tenth of the frequency of SYNC, {most} Hz"),
            );
        }
        let modes = self.modes.get_ref().iter();
        let modes: Vec<_> = modes
            .map(|&[frequency, damping]| Vibration { frequency, damping })
            .collect();
        Shaper::new(self.kind, &modes)
    }
}
