//! Time to compute the equilibrium and the eight coefficients of one bearing.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mechid_bearing::{Bore, Conditions, FiniteBearing, ShortBearing, ShortFilm};

fn equilibrium(c: &mut Criterion) {
    let groove = 20_f64.to_radians();
    for (name, bore, ratio, sommerfeld) in [
        ("plain", Bore::plain(), 1.0, 0.2),
        ("two axial grooves", Bore::two_axial_grooves(groove).unwrap(), 1.0, 0.108),
        ("elliptical", Bore::elliptical(0.5, groove).unwrap(), 1.0, 0.097),
    ] {
        let bearing = FiniteBearing::new(bore, ratio).unwrap();
        c.bench_function(name, |b| b.iter(|| bearing.equilibrium(black_box(sommerfeld))));
    }
    let short = ShortBearing::new(0.5).unwrap();
    c.bench_function("short", |b| b.iter(|| short.equilibrium(black_box(0.5))));
    let film = ShortFilm::new(Conditions {
        diameter: 0.05,
        length: 0.0125,
        clearance: 50e-6,
        viscosity: 0.02,
        omega: 300.0,
    })
    .unwrap();
    c.bench_function("force of a short film", |b| {
        b.iter(|| film.force(black_box([2e-5, 1e-5]), black_box([1e-3, -2e-3])));
    });
}

criterion_group!(benches, equilibrium);
criterion_main!(benches);
