-- percent of a baseline's simulated joules that MapSense saves: interval over seeds, range of sweep
with swept as (
  select building, storey, baseline, min(saving) as least, max(saving) as most
  from energy_sweep
  group by building, storey, baseline
)
select s.building, s.storey, s.series, s.n_queries, s.baseline,
       round(100 * s.saving, 1) as saving_percent,
       round(100 * s.saving_low95, 1) as low95_percent,
       round(100 * s.saving_high95, 1) as high95_percent,
       s.n_seeds as seeds,
       s.unanswered, s.baseline_unanswered,
       -- the sweep is of one query per room
       round(100 * w.least, 1) as sweep_least_percent,
       round(100 * w.most, 1) as sweep_most_percent
from savings s
left join swept w
  on s.series = 'storey' and w.building = s.building and w.storey = s.storey
  and w.baseline = s.baseline
order by s.building, s.storey, s.series desc, s.n_queries, s.baseline
