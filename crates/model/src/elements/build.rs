//! Conversion of the description of a machine to its terms.

use std::collections::HashMap;

use super::assembly::OwnLoad;
use crate::limits::LISTED_NAMES;

use super::{
    Assembly, Coefficient, Element, FreeCoefficient, Instruments, Machine, MachineError,
    MachineParameter, Pattern, Power, SUPPORT, Speed, Term,
};

pub(super) fn assembly(
    machine: &Machine,
    instruments: &Instruments,
) -> Result<Assembly, MachineError> {
    check_names(machine, instruments)?;
    let mut builder = Builder::new(machine, instruments.speed)?;
    for (name, element) in &machine.elements {
        builder.add(name, element)?;
    }
    builder.check_masses(machine)?;
    if instruments.sensors.is_empty() {
        return Err(MachineError::NoInstrument { what: "sensors" });
    }
    if instruments.inputs.is_empty() && builder.loads.is_empty() {
        return Err(MachineError::NoInstrument { what: "inputs" });
    }
    let sensors = instruments.sensors.iter().map(|sensor| builder.sensor(sensor));
    let sensors = sensors.collect::<Result<_, _>>()?;
    let unused = machine.parameters.iter().find(|(name, _)| !builder.shared.contains_key(name));
    if let Some((name, _)) = unused {
        return Err(MachineError::UnusedParameter { name: name.clone() });
    }
    let inputs = instruments.inputs.iter().map(|input| builder.input(input));
    let inputs = inputs.collect::<Result<_, _>>()?;
    let measured = machine.measured.iter().map(|dof| builder.dof("machine", "measured", dof));
    let measured = measured.collect::<Result<_, _>>()?;
    Ok(Assembly {
        dofs: machine.dofs.clone(),
        terms: builder.terms,
        sensors,
        inputs,
        loads: builder.loads,
        parameters: builder.parameters,
        speed: instruments.speed,
        measured,
    })
}

fn check_names(machine: &Machine, instruments: &Instruments) -> Result<(), MachineError> {
    if machine.dofs.is_empty() {
        return Err(MachineError::NoDof);
    }
    if machine.dofs.iter().any(|dof| dof == SUPPORT) {
        return Err(MachineError::Reserved);
    }
    let names: [(&'static str, Vec<&String>); 4] = [
        ("degree of freedom", machine.dofs.iter().collect()),
        ("element", machine.elements.iter().map(|(name, _)| name).collect()),
        ("parameter", machine.parameters.iter().map(|(name, _)| name).collect()),
        ("sensor", instruments.sensors.iter().map(|sensor| &sensor.name).collect()),
    ];
    for (what, mut names) in names {
        names.sort();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(MachineError::Repeated { what, name: pair[0].clone() });
        }
    }
    Ok(())
}

/// Returns the names separated by commas; if there are many, only the first names and an ellipsis.
fn listed(names: &[String]) -> String {
    match names.get(..LISTED_NAMES) {
        Some(first) if names.len() > LISTED_NAMES => format!("{} …", first.join(", ")),
        _ => names.join(", "),
    }
}

/// Known coefficient, or index of an unknown.
#[derive(Clone, Copy)]
pub(super) enum Factor {
    Known(f64),
    Unknown(usize),
}

/// Terms of the elements that were converted so far.
pub(super) struct Builder<'a> {
    pub(super) machine: &'a Machine,
    index: HashMap<&'a str, usize>,
    /// 1 for each degree of freedom in the direction of the motion of the support, 0 for the
    /// others.
    pub(super) direction: Vec<f64>,
    pub(super) speed: Speed,
    terms: Vec<Term>,
    pub(super) loads: Vec<OwnLoad>,
    parameters: Vec<MachineParameter>,
    shared: HashMap<String, usize>,
    /// Elements at each degree of freedom, and `true` if one of them is a mass.
    touched: Vec<(Vec<String>, bool)>,
    pub(super) alpha: Factor,
    pub(super) beta: Factor,
    pub(super) loss_factor: Factor,
}

impl<'a> Builder<'a> {
    fn new(machine: &'a Machine, speed: Speed) -> Result<Self, MachineError> {
        let index: HashMap<&str, usize> =
            machine.dofs.iter().enumerate().map(|(at, name)| (name.as_str(), at)).collect();
        let zero = Factor::Known(0.0);
        let mut builder = Self {
            machine,
            index,
            direction: vec![1.0; machine.dofs.len()],
            speed,
            terms: Vec::new(),
            loads: Vec::new(),
            parameters: Vec::new(),
            shared: HashMap::new(),
            touched: vec![(Vec::new(), false); machine.dofs.len()],
            alpha: zero,
            beta: zero,
            loss_factor: zero,
        };
        if let Some(moving) = &machine.support_direction {
            builder.direction.fill(0.0);
            for dof in moving {
                let at = builder.dof("machine", "support_direction", dof)?;
                builder.direction[at] = 1.0;
            }
        }
        let damping = &machine.damping;
        builder.alpha = builder.factor("alpha", "1/s", &damping.alpha)?;
        builder.beta = builder.factor("beta", "s", &damping.beta)?;
        builder.loss_factor = builder.factor("loss_factor", "", &damping.loss_factor)?;
        Ok(builder)
    }

    /// Returns the index of a degree of freedom that an element, sensor or input names.
    pub(super) fn dof(
        &self,
        what: &'static str,
        name: &str,
        dof: &str,
    ) -> Result<usize, MachineError> {
        self.index.get(dof).copied().ok_or_else(|| MachineError::UnknownDof {
            what,
            name: name.to_owned(),
            dof: dof.to_owned(),
            known: listed(&self.machine.dofs),
        })
    }

    /// Returns the entries of e_i − e_j for two ends i and j. One end may be the support, which
    /// moves only in the direction of its prescribed motion.
    pub(super) fn difference(
        &self,
        what: &'static str,
        name: &str,
        [one, other]: [&str; 2],
    ) -> Result<Vec<(usize, f64)>, MachineError> {
        if one == other {
            let (name, dof) = (name.to_owned(), one.to_owned());
            return Err(MachineError::SameEnds { what, name, dof });
        }
        let support = self.machine.dofs.len();
        let pair = match (one, other) {
            (SUPPORT, dof) | (dof, SUPPORT) => {
                let at = self.dof(what, name, dof)?;
                let sign = if one == SUPPORT { -1.0 } else { 1.0 };
                return Ok(vec![(at, sign), (support, -sign * self.direction[at])]);
            }
            pair => pair,
        };
        Ok(vec![(self.dof(what, name, pair.0)?, 1.0), (self.dof(what, name, pair.1)?, -1.0)])
    }

    pub(super) fn factor(
        &mut self,
        name: &str,
        unit: &'static str,
        coefficient: &Coefficient,
    ) -> Result<Factor, MachineError> {
        match coefficient {
            Coefficient::Known(value) if !value.is_finite() => {
                Err(MachineError::NotFinite { name: name.to_owned(), value: *value })
            }
            Coefficient::Known(value) => Ok(Factor::Known(*value)),
            Coefficient::Free(free) => Ok(Factor::Unknown(self.unknown(name, unit, free)?)),
            Coefficient::Shared(parameter) => {
                if let Some(at) = self.shared.get(parameter) {
                    return Ok(Factor::Unknown(*at));
                }
                let described = self.machine.parameters.iter().find(|(of, _)| of == parameter);
                let (_, free) = described.ok_or_else(|| MachineError::UnknownParameter {
                    name: name.to_owned(),
                    parameter: parameter.clone(),
                })?;
                let at = self.unknown(parameter, unit, free)?;
                self.shared.insert(parameter.clone(), at);
                Ok(Factor::Unknown(at))
            }
        }
    }

    fn unknown(
        &mut self,
        name: &str,
        unit: &'static str,
        free: &FreeCoefficient,
    ) -> Result<usize, MachineError> {
        let start = free.checked_start(name)?;
        if self.parameters.iter().any(|parameter| parameter.name == name) {
            return Err(MachineError::Repeated { what: "parameter", name: name.to_owned() });
        }
        let (min, max) = (free.min.unwrap_or(f64::NEG_INFINITY), free.max.unwrap_or(f64::INFINITY));
        let (name, prior) = (name.to_owned(), free.prior);
        self.parameters.push(MachineParameter { name, unit, start, min, max, prior });
        Ok(self.parameters.len() - 1)
    }

    /// Adds the term pattern × power × factors unless it is zero.
    pub(super) fn push(&mut self, pattern: &Pattern, power: Power, factors: &[Factor]) {
        let (mut scale, mut parameters) = (1.0, Vec::new());
        for factor in factors {
            match factor {
                Factor::Known(value) => scale *= value,
                Factor::Unknown(at) => parameters.push(*at),
            }
        }
        if scale != 0.0 {
            self.terms.push(Term { pattern: pattern.clone(), power, scale, parameters });
        }
    }

    pub(super) fn touch(&mut self, name: &str, entries: &[(usize, f64)], is_mass: bool) {
        for (at, _) in entries.iter().filter(|(at, _)| *at < self.machine.dofs.len()) {
            let (elements, has_mass) = &mut self.touched[*at];
            elements.push(format!("{name:?}"));
            *has_mass |= is_mass;
        }
    }

    /// Allows a degree of freedom to have no mass.
    pub(super) fn allow_no_mass(&mut self, at: usize) {
        self.touched[at].1 = true;
    }

    fn add(&mut self, name: &str, element: &Element) -> Result<(), MachineError> {
        match element {
            Element::Mass { at, mass } => self.mass(name, at, mass),
            Element::Link { between, stiffness, damping, loss_factor } => {
                let ends = [between[0].as_str(), between[1].as_str()];
                self.link(name, ends, [stiffness, damping, loss_factor])
            }
            Element::Bearing(bearing) => self.bearing(name, bearing),
            Element::Matrices(matrices) => self.matrices(name, matrices),
            Element::Unbalance { at, real, imaginary } => {
                self.unbalance(name, at, [real, imaginary])
            }
        }
    }

    /// Checks that every degree of freedom has an element and a mass, which may be 0.
    fn check_masses(&self, machine: &Machine) -> Result<(), MachineError> {
        for (dof, (elements, has_mass)) in machine.dofs.iter().zip(&self.touched) {
            if machine.measured.contains(dof) {
                continue;
            }
            if elements.is_empty() {
                return Err(MachineError::Detached { dof: dof.clone() });
            }
            if !has_mass {
                let (dof, elements) = (dof.clone(), elements.join(", "));
                return Err(MachineError::NoMass { dof, elements });
            }
        }
        Ok(())
    }
}
