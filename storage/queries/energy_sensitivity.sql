-- how far each assumption moves the simulated saving: its range of values, and of percent saved
select building, storey, baseline,
       case when second = '' then first else first || ' x ' || second end as assumption,
       count(*) as cases,
       min(first_value) as first_low,
       max(first_value) as first_high,
       min(second_value) as second_low,
       max(second_value) as second_high,
       round(100 * min(saving), 1) as least_percent,
       round(100 * max(saving), 1) as most_percent
from energy_sweep
group by building, storey, baseline, first, second
order by building, storey, baseline, max(saving) - min(saving) desc nulls last, assumption
