//! `[[simulation.dc_bus]]`: drives whose DC buses are joined.

use super::{Axis, Drive, Simulation};
use syncline_strict_toml::{Log, Table, one_of};
use toml::Spanned;

/// One of the tables: the drives' names.
pub(super) struct DcBusTable {
    title: String,
    drives: Vec<Spanned<String>>,
}

/// The tables, if there are any.
pub(super) fn read(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Vec<DcBusTable> {
    let tables = table.tables_if(log, "dc_bus", "drives").into_iter();
    let read = tables.filter_map(|mut table| {
        let allowed = "the names of 2 or more drives";
        let drives = table.texts(log, "drives", allowed, 2..=usize::MAX);
        let title = table.title.clone();
        table.finish(log);
        let drives = drives?.into_inner();
        Some(DcBusTable { title, drives })
    });
    read.collect()
}

/// The drives of each, by their index: each drive once, and with a power stage of its own that is simulated.
pub(super) fn join(
    log: &mut Log<'_>,
    tables: &[DcBusTable],
    drives: &[Drive],
    axes: &[Axis],
) -> Vec<Vec<usize>> {
    let mut known: Vec<usize> = Vec::new();
    let mut buses = Vec::new();
    for DcBusTable {
        title,
        drives: names,
    } in tables
    {
        let mut bus = Vec::new();
        for name in names {
            let named = name.get_ref();
            let Some(index) = drives.iter().position(|it| it.name == *named) else {
                log.report(
                    name.span(),
                    format!("{title}: there is no drive \"{named}\""),
                    format!("allowed: {}", one_of(drives.iter().map(|it| &*it.name))),
                );
                continue;
            };
            let simulation = axes[drives[index].axis].simulation.as_ref();
            if simulation.and_then(Simulation::driven).is_none() {
                log.report(
                    name.span(),
                    format!("{title}: no power stage of \"{named}\" is simulated"),
                    "say in `simulation` of its axis what its `motor` is",
                );
            }
            if known.contains(&index) {
                log.report(
                    name.span(),
                    format!("{title}: \"{named}\" has a DC bus already"),
                    "name each drive once",
                );
            }
            known.push(index);
            bus.push(index);
        }
        buses.push(bus);
    }
    buses
}
